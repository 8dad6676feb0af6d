//! The wall's clock, for worlds whose pilot lives by it.

use crate::flight::STEP;
use std::time::{Duration, Instant};

/// After so many steps at once the machine was asleep or is too slow; the world then loses time instead of racing.
const STEPS_AT_ONCE: u32 = 50;

/// Says when the next [`STEP`] of the aircraft's life is due.
#[derive(Debug)]
pub struct Pace {
    step: Duration,
    next: Instant,
}

impl Pace {
    /// A pace of `haste` seconds of the aircraft's life per second on the wall.
    #[must_use]
    pub fn new(haste: f32) -> Pace {
        Pace { step: Duration::from_micros(STEP.as_micros()).div_f32(haste), next: Instant::now() }
    }

    /// How many steps are due now.
    pub fn due(&mut self) -> u32 {
        let mut steps = 0;
        while Instant::now() >= self.next && steps < STEPS_AT_ONCE {
            self.next += self.step;
            steps += 1;
        }
        if steps == STEPS_AT_ONCE {
            self.next = Instant::now();
        }
        steps
    }

    /// How long until the next one.
    #[must_use]
    pub fn rest(&self) -> Duration {
        self.next.saturating_duration_since(Instant::now())
    }
}
