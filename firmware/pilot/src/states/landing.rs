//! The landing at the end of a mission: requested, confirmed, watched.

use super::Outcome;
use crate::scene::Scene;
use crate::{Fault, Outputs, TakeOver};
use gleaner_link::AutopilotCommand;
use gleaner_units::{Duration, Instant};

/// How often the landing is requested; the link repeats each request.
const ATTEMPTS: u8 = 3;
/// How long the aircraft may be away from the cell of the landing before the landing is given up.
const AWAY: Duration = Duration::from_secs(40);

/// A landing that the autopilot has not confirmed yet. The target stays: on PX4 a silent stream would be a failsafe.
///
/// An autopilot lands where it is. While the line is cut it may stop elsewhere, and accept a request that was made over
/// the right place when the line is back. So a request is withdrawn when the aircraft leaves the cell, and made again when
/// it is back over it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Landing {
    /// A request needs a heartbeat after this.
    reason_at: Instant,
    attempts: u8,
    waiting: bool,
    /// When the aircraft was last over the cell.
    over_at: Instant,
}

impl Landing {
    pub(crate) const fn new(now: Instant) -> Landing {
        Landing { reason_at: now, attempts: 0, waiting: false, over_at: now }
    }

    /// `is_over`: whether the aircraft is over the cell that it is to land in.
    pub(crate) fn step(&mut self, scene: &Scene<'_>, is_over: bool, out: &mut Outputs) -> Outcome {
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
        if !is_over {
            out.withdraw |= core::mem::replace(&mut self.waiting, false);
            let too_long = scene.now.since(self.over_at) > AWAY;
            return if too_long { Outcome::Fault(Fault::LandingRefused) } else { Outcome::Stay };
        }
        self.over_at = scene.now;
        if !self.waiting && scene.is_ours_since(self.reason_at) {
            let attempts = self.attempts.saturating_add(1);
            *self = Landing { reason_at: scene.now, attempts, waiting: true, over_at: scene.now };
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
