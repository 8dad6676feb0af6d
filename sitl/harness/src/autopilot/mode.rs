//! Flight modes that both autopilots have, with their numbers.

use super::AutopilotKind;

/// A flight mode, named after what it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VehicleMode {
    /// The human pilot controls the attitude (ArduCopter STABILIZE, PX4 STABILIZED). Simulated as a pilot who hovers.
    Stabilize,
    /// The human pilot flies, the autopilot holds the altitude (ALT_HOLD, ALTCTL).
    AltitudeHold,
    /// The autopilot follows position targets (GUIDED, OFFBOARD).
    Guided,
    /// The autopilot holds the position (LOITER, HOLD).
    Hold,
    /// The autopilot flies home and lands (RTL).
    Return,
    /// The autopilot lands here (LAND).
    Land,
    /// The autopilot stops and holds (BRAKE, POSCTL with centred sticks).
    Brake,
    /// The autopilot climbs, then holds (PX4 TAKEOFF; ArduCopter takes off in GUIDED).
    TakeOff,
}

impl VehicleMode {
    /// All modes.
    pub const ALL: [VehicleMode; 8] = [
        VehicleMode::Stabilize,
        VehicleMode::AltitudeHold,
        VehicleMode::Guided,
        VehicleMode::Hold,
        VehicleMode::Return,
        VehicleMode::Land,
        VehicleMode::Brake,
        VehicleMode::TakeOff,
    ];

    /// `custom_mode` of the heartbeat; `None` for a mode that this autopilot does not have.
    ///
    /// ArduCopter numbers its modes. PX4 puts the main mode into bits 16 to 23 and the sub mode into bits 24 to 31.
    #[must_use]
    pub const fn custom_mode(self, kind: AutopilotKind) -> Option<u32> {
        Some(match (kind, self) {
            (AutopilotKind::ArduPilot, VehicleMode::Stabilize) => 0,
            (AutopilotKind::ArduPilot, VehicleMode::AltitudeHold) => 2,
            (AutopilotKind::ArduPilot, VehicleMode::Guided) => 4,
            (AutopilotKind::ArduPilot, VehicleMode::Hold) => 5,
            (AutopilotKind::ArduPilot, VehicleMode::Return) => 6,
            (AutopilotKind::ArduPilot, VehicleMode::Land) => 9,
            (AutopilotKind::ArduPilot, VehicleMode::Brake) => 17,
            (AutopilotKind::ArduPilot, VehicleMode::TakeOff) => return None,
            (AutopilotKind::Px4, VehicleMode::AltitudeHold) => 0x0002_0000,
            (AutopilotKind::Px4, VehicleMode::Brake) => 0x0003_0000,
            (AutopilotKind::Px4, VehicleMode::Guided) => 0x0006_0000,
            (AutopilotKind::Px4, VehicleMode::Stabilize) => 0x0007_0000,
            (AutopilotKind::Px4, VehicleMode::TakeOff) => 0x0204_0000,
            (AutopilotKind::Px4, VehicleMode::Hold) => 0x0304_0000,
            (AutopilotKind::Px4, VehicleMode::Return) => 0x0504_0000,
            (AutopilotKind::Px4, VehicleMode::Land) => 0x0604_0000,
        })
    }

    /// The mode with this `custom_mode`, `None` for a number that is not simulated.
    #[must_use]
    pub fn from_custom_mode(kind: AutopilotKind, custom_mode: u32) -> Option<VehicleMode> {
        VehicleMode::ALL.into_iter().find(|mode| mode.custom_mode(kind) == Some(custom_mode))
    }

    /// Lower-case name for messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            VehicleMode::Stabilize => "stabilize",
            VehicleMode::AltitudeHold => "altitude hold",
            VehicleMode::Guided => "guided",
            VehicleMode::Hold => "hold",
            VehicleMode::Return => "return",
            VehicleMode::Land => "land",
            VehicleMode::Brake => "brake",
            VehicleMode::TakeOff => "take-off",
        }
    }

    /// Whether the mode needs a position estimate.
    pub(super) const fn needs_position(self) -> bool {
        matches!(self, VehicleMode::Hold | VehicleMode::Return | VehicleMode::Brake | VehicleMode::TakeOff)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_for_both_autopilots() {
        for kind in AutopilotKind::ALL {
            for mode in VehicleMode::ALL {
                if let Some(number) = mode.custom_mode(kind) {
                    assert_eq!(VehicleMode::from_custom_mode(kind, number), Some(mode));
                }
            }
        }
        assert_eq!(VehicleMode::from_custom_mode(AutopilotKind::ArduPilot, 99), None);
    }
}
