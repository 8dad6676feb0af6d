//! The landing at the end of a mission: requested, confirmed, watched.

use super::Outcome;
use crate::scene::Scene;
use crate::{Fault, Outputs, TakeOver};
use gleaner_link::AutopilotCommand;
use gleaner_units::Instant;

/// How often the landing is requested; the link repeats each request.
const ATTEMPTS: u8 = 3;

/// A landing that the autopilot has not confirmed yet. The target stays: on PX4 a silent stream would be a failsafe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Landing {
    /// A request needs a heartbeat after this.
    reason_at: Instant,
    attempts: u8,
    waiting: bool,
}

impl Landing {
    pub(crate) const fn new(now: Instant) -> Landing {
        Landing { reason_at: now, attempts: 0, waiting: false }
    }

    pub(crate) fn step(&mut self, scene: &Scene<'_>, out: &mut Outputs) -> Outcome {
        let ended = |accepted| scene.inputs.ended.contains(&(AutopilotCommand::Land, accepted));
        if ended(true) {
            return Outcome::Done { landed: false };
        }
        if ended(false) {
            if self.attempts >= ATTEMPTS {
                return Outcome::Fault(Fault::LandingRefused);
            }
            self.waiting = false;
        }
        if !self.waiting && scene.is_ours_since(self.reason_at) {
            *self = Landing { reason_at: scene.now, attempts: self.attempts + 1, waiting: true };
            out.command = Some(AutopilotCommand::Land);
        }
        Outcome::Stay
    }
}

/// Watches a landing that was confirmed; the human pilot may still take over.
pub(crate) fn descend(scene: &Scene<'_>, landed: bool) -> Outcome {
    let vehicle = scene.vehicle();
    if landed {
        Outcome::Stay
    } else if !vehicle.armed || vehicle.on_ground {
        Outcome::Done { landed: true }
    } else if vehicle.is_taken() && !vehicle.is_landing_or_returning() {
        Outcome::Passive(TakeOver::Mode)
    } else {
        Outcome::Stay
    }
}
