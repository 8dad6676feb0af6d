//! What can be wrong with the wires between pilot, autopilot and radio.

use gleaner_units::{Duration, Instant};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt;

/// A fault of the wires.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WireFault {
    /// The radio reports nothing.
    RadioSilent,
    /// Nothing passes between pilot and autopilot.
    LineCut,
    /// Between pilot and autopilot one byte in so many becomes another.
    LineNoise(u32),
}

impl fmt::Display for WireFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WireFault::RadioSilent => write!(f, "the radio is silent"),
            WireFault::LineCut => write!(f, "the line to the autopilot is cut"),
            WireFault::LineNoise(one_in) => {
                write!(f, "on the line to the autopilot one byte in {one_in} is wrong")
            }
        }
    }
}

/// The wires, and until when something is wrong with them.
#[derive(Debug)]
pub(crate) struct Wires {
    silent_until: Instant,
    cut_until: Instant,
    noise: (u32, Instant),
    rng: ChaCha8Rng,
}

impl Wires {
    /// Good wires; `seed` names the noise that they may have.
    pub fn new(seed: u64) -> Wires {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Wires { silent_until: Instant::ZERO, cut_until: Instant::ZERO, noise: (1, Instant::ZERO), rng }
    }

    pub fn fail(&mut self, now: Instant, fault: WireFault, lasts: Duration) {
        let until = now + lasts;
        match fault {
            WireFault::RadioSilent => self.silent_until = until,
            WireFault::LineCut => self.cut_until = until,
            WireFault::LineNoise(one_in) => self.noise = (one_in.max(1), until),
        }
    }

    pub fn radio_is_silent(&self, now: Instant) -> bool {
        now < self.silent_until
    }

    /// The bytes as they come out at the other end.
    pub fn carry(&mut self, now: Instant, mut bytes: Vec<u8>) -> Vec<u8> {
        if now < self.cut_until {
            return Vec::new();
        }
        let (one_in, until) = self.noise;
        if now < until {
            for byte in &mut bytes {
                if self.rng.random_ratio(1, one_in) {
                    *byte = self.rng.next_u32() as u8;
                }
            }
        }
        bytes
    }
}
