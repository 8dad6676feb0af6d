//! The states of the pilot, and the reasons that it gives for them.

use serde::{Deserialize, Serialize};

/// What the pilot is doing.
///
/// ```text
///                 self-test failed
///        Boot ------------------------> Fault (never leaves)
///          | passed
///          v       request shadow
///   +--> Idle <---------------------> Shadow        decides and logs, commands nothing
///   |      | request engage
///   |      v
///   |   Waiting --- GUIDED left again, failsafe ---> Passive
///   |      | every condition holds
///   |      v
///   |   Engaged --- another mode ------------------> Passive --- new request ---> Waiting, Shadow, Idle
///   |      | a move entered the terminal,     \
///   |      | return, low battery, failsafe,    \ position lost, autopilot lost,
///   |      | policy failed, no progress         \ late poll, no progress at all
///   |      v                                     v
///   |   Homing -- another mode -> Passive      Fault --- new request ---> Waiting, Shadow, Idle
///   |      | landing confirmed
///   |      v
///   |    Done    landing, then landed --- another mode while landing -> Passive
///   |
///   +--- request off: from every state. Disarmed: from Waiting, Engaged and Homing (Done when landing).
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum State {
    /// The self-test has not been looked at yet.
    Boot,
    /// Nothing was asked for.
    Idle,
    /// The operator asked to engage; a condition is missing.
    Waiting,
    /// The policy flies.
    Engaged,
    /// The guard flies to the terminal and lands there.
    Homing,
    /// The autopilot lands or has landed at the terminal.
    Done,
    /// The human pilot or a failsafe has the aircraft.
    Passive,
    /// The pilot gave up; see [`Fault`].
    Fault,
    /// Decides and logs, commands nothing.
    Shadow,
}

impl State {
    /// Every state.
    pub const ALL: [State; 9] = [
        State::Boot,
        State::Idle,
        State::Waiting,
        State::Engaged,
        State::Homing,
        State::Done,
        State::Passive,
        State::Fault,
        State::Shadow,
    ];

    /// Lower-case English name, as logs and pages print it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            State::Boot => "boot",
            State::Idle => "idle",
            State::Waiting => "waiting",
            State::Engaged => "engaged",
            State::Homing => "homing",
            State::Done => "done",
            State::Passive => "passive",
            State::Fault => "fault",
            State::Shadow => "shadow",
        }
    }

    /// Whether targets or commands of ours may be under way in this state. (A fault may still ask the autopilot
    /// to return, see [`Fault`].)
    #[must_use]
    pub const fn commands(self) -> bool {
        matches!(self, State::Waiting | State::Engaged | State::Homing)
    }
}

/// What is still missing before the mission can be engaged, in the order in which it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Missing {
    /// No heartbeat of an autopilot for 5 s.
    Autopilot,
    /// A failsafe is latched.
    FailsafeClear,
    /// The engage-inhibit input is active.
    Permission,
    /// The estimator's origin is unknown.
    Origin,
    /// No position, or an old one.
    Position,
    /// The estimator does not trust its position, or says nothing.
    Estimator,
    /// The take-off point is unknown.
    Home,
    /// The battery percentage is unknown.
    Battery,
    /// The flight altitude does not clear the tallest building.
    SafeAltitude,
    /// The motors are not armed.
    Armed,
    /// The mode is not GUIDED or OFFBOARD.
    GuidedMode,
    /// Not within a few metres of the flight altitude.
    Altitude,
    /// Not over the grid and inside the fence, or cut off from the terminal.
    InsideFence,
    /// The battery does not cover the way home and the reserve.
    EnoughBattery,
}

impl Missing {
    /// What to say to the operator, at most 40 characters.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Missing::Autopilot => "no autopilot heard",
            Missing::FailsafeClear => "autopilot failsafe is set",
            Missing::Permission => "engage inhibit input is active",
            Missing::Estimator => "estimator not healthy",
            Missing::Position => "no fresh position",
            Missing::Origin => "no estimator origin",
            Missing::Home => "no home position",
            Missing::Battery => "no battery percentage",
            Missing::SafeAltitude => "GLN_ALT is below the buildings",
            Missing::Armed => "not armed",
            Missing::GuidedMode => "mode is not GUIDED/OFFBOARD",
            Missing::Altitude => "not at GLN_ALT",
            Missing::InsideFence => "outside the grid or fence",
            Missing::EnoughBattery => "battery below way home + reserve",
        }
    }
}

/// Why the pilot goes home before the policy says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ReturnReason {
    /// A move of the policy entered the terminal: the regular end.
    Terminal,
    /// `MAV_CMD_USER_3`.
    Request,
    /// The battery no longer covers the way home and the reserve.
    Battery,
    /// The autopilot latched a failsafe but stayed in its mode.
    Failsafe,
    /// The policy gave no answer, or one that is not a number.
    Policy,
    /// 20 s without getting nearer to the target.
    NoProgress,
}

impl ReturnReason {
    /// What to say to the operator, at most 40 characters.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            ReturnReason::Terminal => "terminal reached",
            ReturnReason::Request => "return requested",
            ReturnReason::Battery => "battery is low",
            ReturnReason::Failsafe => "autopilot failsafe",
            ReturnReason::Policy => "policy failed",
            ReturnReason::NoProgress => "no progress for 20 s, fence?",
        }
    }
}

/// Why the pilot gave up. Targets stop. After a fault in flight the autopilot is asked once to return to launch,
/// while it is still in our mode. All but [`Fault::SelfTest`] end with a new request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    /// The engine does not reproduce the model's golden pairs.
    SelfTest,
    /// No heartbeat of the autopilot for 5 s.
    AutopilotLost,
    /// No position for 2 s, or the estimator no longer trusts it.
    PositionLost,
    /// The program polled too late: the autopilot may already have acted.
    Late,
    /// 40 s without getting nearer to any target.
    NoProgress,
    /// The autopilot does not confirm the landing.
    LandingRefused,
    /// There is no way to the terminal from here.
    NoWayHome,
}

impl Fault {
    /// What to say to the operator, at most 40 characters.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Fault::SelfTest => "self-test failed, will not engage",
            Fault::AutopilotLost => "autopilot lost for 5 s",
            Fault::PositionLost => "position lost for 2 s",
            Fault::Late => "decision loop late",
            Fault::NoProgress => "no progress for 40 s",
            Fault::LandingRefused => "landing not confirmed",
            Fault::NoWayHome => "no way to the terminal",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One `STATUSTEXT` has 50 characters; a longer line would arrive cut.
    #[test]
    fn every_reason_fits_one_status_text() {
        let missing = [
            Missing::Autopilot,
            Missing::FailsafeClear,
            Missing::Permission,
            Missing::Estimator,
            Missing::Position,
            Missing::Origin,
            Missing::Home,
            Missing::Battery,
            Missing::SafeAltitude,
            Missing::Armed,
            Missing::GuidedMode,
            Missing::Altitude,
            Missing::InsideFence,
            Missing::EnoughBattery,
        ];
        assert!(missing.iter().all(|missing| missing.text().len() <= 50 - "gleaner: waiting: ".len()));
        let reasons = [
            ReturnReason::Terminal,
            ReturnReason::Request,
            ReturnReason::Battery,
            ReturnReason::Failsafe,
            ReturnReason::Policy,
            ReturnReason::NoProgress,
        ];
        assert!(reasons.iter().all(|reason| reason.text().len() <= 50 - "gleaner: going home: ".len()));
        let faults = [
            Fault::SelfTest,
            Fault::AutopilotLost,
            Fault::PositionLost,
            Fault::Late,
            Fault::NoProgress,
            Fault::LandingRefused,
            Fault::NoWayHome,
        ];
        assert!(faults.iter().all(|fault| fault.text().len() <= 50 - "gleaner: fault: ".len()));
    }
}
