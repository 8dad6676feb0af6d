//! The wall clock, for simulations with a pilot outside this process.

use crate::flight::STEP;
use std::time::{Duration, Instant};

/// With more steps than this due at once, the machine was asleep or is too slow. The simulation then loses time
/// instead of catching up.
const STEPS_AT_ONCE: u32 = 50;

/// Says when the next [`STEP`] is due.
#[derive(Debug)]
pub struct Pace {
    step: Duration,
    next: Instant,
}

impl Pace {
    /// A pace of `speedup` aircraft seconds per second of the wall clock.
    #[must_use]
    pub fn new(speedup: f32) -> Pace {
        Pace { step: Duration::from_micros(STEP.as_micros()).div_f32(speedup), next: Instant::now() }
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
