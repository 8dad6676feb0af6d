//! Our commands to the autopilot.

use crate::mode::Firmware;
use gleaner_units::MetresPerSecond;
use mavlink::dialects::ardupilotmega::MavCmd;

/// A command to the autopilot. There is none for a mode in which we steer: only the pilot of the aircraft or the
/// operator can give us control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AutopilotCommand {
    /// `MAV_CMD_NAV_LAND`: land here.
    Land,
    /// `MAV_CMD_NAV_RETURN_TO_LAUNCH`.
    ReturnToLaunch,
    /// `MAV_CMD_DO_SET_MODE` to a mode that holds the position without the sticks: BRAKE of ArduCopter, HOLD of PX4.
    Hold(Firmware),
    /// `MAV_CMD_DO_CHANGE_SPEED`, ground speed. PX4 accepts it without effect in OFFBOARD.
    ChangeSpeed(MetresPerSecond),
}

impl AutopilotCommand {
    /// Their `MAV_CMD`s: each moves the aircraft.
    pub(crate) const KINDS: [MavCmd; 4] = [
        MavCmd::MAV_CMD_NAV_LAND,
        MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH,
        MavCmd::MAV_CMD_DO_SET_MODE,
        MavCmd::MAV_CMD_DO_CHANGE_SPEED,
    ];

    /// `MAV_CMD` and parameters 1..3.
    pub(crate) fn wire(self) -> (MavCmd, [f32; 3]) {
        match self {
            AutopilotCommand::Land => (MavCmd::MAV_CMD_NAV_LAND, [0.0; 3]),
            AutopilotCommand::ReturnToLaunch => (MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, [0.0; 3]),
            // 1: `custom_mode` counts. ArduCopter's LOITER would follow the throttle stick, BRAKE needs no transmitter.
            AutopilotCommand::Hold(Firmware::ArduPilot) => (MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 17.0, 0.0]),
            // Main mode AUTO, sub mode LOITER.
            AutopilotCommand::Hold(Firmware::Px4) => (MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 3.0]),
            AutopilotCommand::Hold(Firmware::Other(_)) => AutopilotCommand::ReturnToLaunch.wire(),
            // 1: ground speed; throttle -1: no change.
            AutopilotCommand::ChangeSpeed(speed) => (MavCmd::MAV_CMD_DO_CHANGE_SPEED, [1.0, speed.0, -1.0]),
        }
    }

    pub(crate) fn is_finite(self) -> bool {
        self.wire().1.iter().all(|param| param.is_finite())
    }

    pub(crate) fn is_same_kind(self, other: AutopilotCommand) -> bool {
        self.wire().0 == other.wire().0
    }
}
