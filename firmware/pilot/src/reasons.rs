//! The reasons that the pilot gives for its states.

/// A condition that is missing before the mission can be engaged, in the order of the checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Missing {
    /// No heartbeat of an autopilot for 5 s.
    Autopilot,
    /// The engage-inhibit input is active.
    Permission,
    /// The estimator's origin is unknown.
    Origin,
    /// No position, or an old one.
    Position,
    /// The estimator does not trust its position, or reports nothing.
    Estimator,
    /// The take-off point is unknown.
    Home,
    /// The battery percentage is unknown.
    Battery,
    /// Neither a byte nor a report of a radio has arrived.
    Radio,
    /// The flight altitude, less the tolerance, does not clear the tallest building.
    SafeAltitude,
    /// The motors are not armed.
    Armed,
    /// The mode is not GUIDED or OFFBOARD.
    GuidedMode,
    /// No heartbeat since the request, or since the program last stalled.
    Heartbeat,
    /// Not within a few metres of the flight altitude.
    Altitude,
    /// Not over the grid and inside the fence, or cut off from the terminal.
    InsideFence,
    /// The battery does not cover the way home, the landing and the reserve.
    EnoughBattery,
}

impl Missing {
    /// All of them, in the order of the checks.
    pub const ALL: [Missing; 15] = [
        Missing::Autopilot,
        Missing::Permission,
        Missing::Origin,
        Missing::Position,
        Missing::Estimator,
        Missing::Home,
        Missing::Battery,
        Missing::Radio,
        Missing::SafeAltitude,
        Missing::Armed,
        Missing::GuidedMode,
        Missing::Heartbeat,
        Missing::Altitude,
        Missing::InsideFence,
        Missing::EnoughBattery,
    ];

    /// For the operator, at most 33 characters.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Missing::Autopilot => "no autopilot heard",
            Missing::Permission => "engage inhibit input is active",
            Missing::Estimator => "estimator not healthy",
            Missing::Position => "no fresh position",
            Missing::Origin => "no estimator origin",
            Missing::Home => "no home position",
            Missing::Battery => "no battery percentage",
            Missing::Radio => "no byte from the radio",
            Missing::SafeAltitude => "GLN_ALT is below the buildings",
            Missing::Armed => "not armed",
            Missing::GuidedMode => "mode is not GUIDED/OFFBOARD",
            Missing::Heartbeat => "no heartbeat since the request",
            Missing::Altitude => "not at GLN_ALT",
            Missing::InsideFence => "outside the grid or fence",
            Missing::EnoughBattery => "battery below way home + reserve",
        }
    }
}

/// Why the pilot goes home before the policy decides so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ReturnReason {
    /// A move of the policy entered the terminal: the regular end.
    Terminal,
    /// `MAV_CMD_USER_3`.
    Request,
    /// The battery no longer covers the way home, the landing and the reserve.
    Battery,
    /// The battery percentage is unknown.
    BatteryUnknown,
    /// The autopilot latched a failsafe but stayed in its mode.
    Failsafe,
    /// The policy failed, or its answer is not finite.
    Policy,
    /// 20 s without getting nearer to the target.
    NoProgress,
    /// The position jumped by more than the aircraft can fly.
    PositionJump,
    /// No report of any device for [`crate::Rules::blind_return`].
    RadioSilent,
}

impl ReturnReason {
    /// All of them.
    pub const ALL: [ReturnReason; 9] = [
        ReturnReason::Terminal,
        ReturnReason::Request,
        ReturnReason::Battery,
        ReturnReason::BatteryUnknown,
        ReturnReason::Failsafe,
        ReturnReason::Policy,
        ReturnReason::NoProgress,
        ReturnReason::PositionJump,
        ReturnReason::RadioSilent,
    ];

    /// For the operator, at most 29 characters.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            ReturnReason::Terminal => "terminal reached",
            ReturnReason::Request => "return requested",
            ReturnReason::Battery => "battery is low",
            ReturnReason::BatteryUnknown => "battery unknown",
            ReturnReason::Failsafe => "autopilot failsafe",
            ReturnReason::Policy => "policy failed",
            ReturnReason::NoProgress => "no progress for 20 s, fence?",
            ReturnReason::PositionJump => "position jumped",
            ReturnReason::RadioSilent => "radio silent",
        }
    }
}

/// How someone else got the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TakeOver {
    /// A heartbeat showed a mode that is not ours.
    Mode,
    /// The autopilot follows a target that we did not send.
    Target,
    /// The aircraft is away from where we sent it.
    Place,
}

impl TakeOver {
    /// All of them.
    pub const ALL: [TakeOver; 3] = [TakeOver::Mode, TakeOver::Target, TakeOver::Place];

    /// For the operator, at most 32 characters.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            TakeOver::Mode => "someone else has control",
            TakeOver::Target => "a target is not ours",
            TakeOver::Place => "moved by another",
        }
    }
}

/// Why the pilot gave up. Targets stop. After a fault in flight the autopilot is requested to return to launch, each
/// time only after a newer heartbeat shows that the aircraft is still ours. All but [`Fault::SelfTest`] end with a new
/// request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    /// The engine does not reproduce the model's golden pairs.
    SelfTest,
    /// No heartbeat of the autopilot for 5 s.
    AutopilotLost,
    /// No position for 2 s, or the estimator no longer trusts it, or it jumped again on the way home.
    PositionLost,
    /// The estimator's origin moved: every target would be off.
    OriginMoved,
    /// The aircraft is away from its altitude, perhaps below the roofs.
    AltitudeLost,
    /// The program polled too late: the autopilot may already have acted.
    Late,
    /// 40 s without getting nearer to any target.
    NoProgress,
    /// The autopilot does not confirm the landing.
    LandingRefused,
    /// There is no way to the terminal from here.
    NoWayHome,
    /// PX4 latched a failsafe: targets could clear it.
    Failsafe,
    /// The program ends.
    Stopped,
}

impl Fault {
    /// All of them.
    pub const ALL: [Fault; 11] = [
        Fault::SelfTest,
        Fault::AutopilotLost,
        Fault::PositionLost,
        Fault::OriginMoved,
        Fault::AltitudeLost,
        Fault::Late,
        Fault::NoProgress,
        Fault::LandingRefused,
        Fault::NoWayHome,
        Fault::Failsafe,
        Fault::Stopped,
    ];

    /// For the operator, at most 34 characters.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Fault::SelfTest => "self-test failed, will not engage",
            Fault::AutopilotLost => "autopilot lost for 5 s",
            Fault::PositionLost => "position lost for 2 s",
            Fault::OriginMoved => "estimator origin moved",
            Fault::AltitudeLost => "altitude lost",
            Fault::Late => "decision loop late",
            Fault::NoProgress => "no progress for 40 s",
            Fault::LandingRefused => "landing not confirmed",
            Fault::NoWayHome => "no way to the terminal",
            Fault::Failsafe => "autopilot failsafe",
            Fault::Stopped => "program ends in flight",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One `STATUSTEXT` has 50 characters; a longer line would be cut.
    #[test]
    fn every_reason_fits_one_status_text() {
        let room = |prefix: &str| 50 - prefix.len();
        assert!(Missing::ALL.iter().all(|missing| missing.text().len() <= room("gleaner: waiting: ")));
        assert!(ReturnReason::ALL.iter().all(|reason| reason.text().len() <= room("gleaner: going home: ")));
        assert!(TakeOver::ALL.iter().all(|take_over| take_over.text().len() <= room("gleaner: passive, ")));
        assert!(Fault::ALL.iter().all(|fault| fault.text().len() <= room("gleaner: fault: ")));
    }
}
