//! After a fault in flight: the aircraft is given back to the autopilot.

use super::Outcome;
use crate::Outputs;
use crate::scene::Scene;
use gleaner_link::{AutopilotCommand, Severity};
use gleaner_units::{Duration, Instant, Ned};

/// How many transmissions of the link fail before the operator is warned.
const ATTEMPTS: u8 = 3;
/// Pause before the next request.
const PAUSE: Duration = Duration::from_secs(2);
/// The same once [`ATTEMPTS`] have failed.
const LONG_PAUSE: Duration = Duration::from_secs(10);

/// The request to return to launch, or to hold the position where the program ends and its user has set that.
///
/// ArduCopter keeps a position target without a timeout: without this request it would hover until its battery is empty.
/// So the request is repeated until it is accepted, however long the line is bad. PX4 returns by itself one second
/// after the targets stop.
///
/// Each request needs a heartbeat that arrived after the fault, and after the last attempt, and shows that the aircraft
/// is ours (armed, GUIDED or OFFBOARD). Any other mode, a target that is not ours, and an aircraft away from where it was
/// left end it: someone else has the aircraft then. It is the same safe way out for all faults: the estimator's failsafe
/// overrides it where a position is needed and missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HandBack {
    /// `None` once there is nothing to give back.
    left: Option<Left>,
    command: AutopilotCommand,
    /// A request needs a heartbeat after this.
    reason_at: Instant,
    /// When it may be requested again.
    request_at: Instant,
    waiting: bool,
    failures: u16,
}

/// Where the aircraft was left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Left {
    /// The last target.
    pub(crate) at: Ned,
    /// Within this distance of it the aircraft may still be on its way.
    pub(crate) within_m: f32,
    /// Whether the autopilot fell silent since.
    pub(crate) unheard: bool,
}

impl HandBack {
    /// There is nothing to give back.
    pub(crate) const fn nothing() -> HandBack {
        HandBack {
            left: None,
            command: AutopilotCommand::ReturnToLaunch,
            reason_at: Instant::ZERO,
            request_at: Instant::ZERO,
            waiting: false,
            failures: 0,
        }
    }

    /// The aircraft is to be given back for a reason that arose now.
    pub(crate) const fn new(now: Instant, left: Left, command: AutopilotCommand) -> HandBack {
        HandBack { left: Some(left), command, reason_at: now, request_at: now, waiting: false, failures: 0 }
    }

    /// Whether the aircraft still has to be given back.
    pub(crate) const fn is_pending(&self) -> bool {
        self.left.is_some()
    }

    pub(crate) fn step(&mut self, scene: &Scene<'_>, out: &mut Outputs) -> Outcome {
        let (vehicle, inputs) = (scene.vehicle(), scene.inputs);
        let requested = self.command;
        for (_, accepted) in inputs.ended.iter().filter(|(command, _)| *command == requested) {
            if *accepted {
                *self = HandBack::nothing();
            } else {
                self.failed(scene.now, out);
            }
        }
        if vehicle.is_taken() || inputs.other_mode_seen || (vehicle.mode.is_some() && !vehicle.armed) {
            self.give_up(out);
        }
        let Some(left) = &mut self.left else { return Outcome::Stay };
        left.unheard |= vehicle.mode.is_none();
        let is_moved =
            vehicle.position.map(|position| position.horizontal_distance(&left.at).0 > left.within_m);
        // Without a position it is unknown whether it was moved while the autopilot was silent.
        let is_where_left = is_moved.map_or(!left.unheard, |is_moved| !is_moved);
        if vehicle.is_guided() && (inputs.foreign_target || is_moved == Some(true)) {
            out.say(Severity::Critical, format_args!("gleaner: moved by another, left to you"));
            self.give_up(out);
            return Outcome::Stay;
        }
        let may_request = !self.waiting && scene.now >= self.request_at && is_where_left;
        if may_request && scene.is_ours_since(self.reason_at) {
            self.waiting = true;
            self.reason_at = scene.now;
            out.command = Some(self.command);
        }
        Outcome::Stay
    }

    fn give_up(&mut self, out: &mut Outputs) {
        out.withdraw |= self.waiting;
        *self = HandBack::nothing();
    }

    /// Refused, or not answered.
    fn failed(&mut self, now: Instant, out: &mut Outputs) {
        if self.left.is_none() {
            return;
        }
        self.failures = self.failures.wrapping_add(1);
        self.waiting = false;
        if self.failures.is_multiple_of(u16::from(ATTEMPTS)) {
            let verb = if self.command == AutopilotCommand::ReturnToLaunch { "return" } else { "hold" };
            out.say(Severity::Critical, format_args!("gleaner: autopilot does not {verb}, take over"));
        }
        self.request_at = now + if self.failures < u16::from(ATTEMPTS) { PAUSE } else { LONG_PAUSE };
    }
}
