//! Flight modes of the two autopilots, as far as they matter to a companion.

/// Which flight stack the autopilot runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Firmware {
    /// ArduPilot.
    ArduPilot,
    /// PX4.
    Px4,
    /// Something else, with its `MAV_AUTOPILOT` number. Its modes are all [`FlightMode::Other`].
    Other(u8),
}

impl Firmware {
    /// From `MAV_AUTOPILOT`.
    #[must_use]
    pub const fn from_wire(autopilot: u8) -> Firmware {
        match autopilot {
            3 => Firmware::ArduPilot,
            12 => Firmware::Px4,
            other => Firmware::Other(other),
        }
    }
}

/// The mode that the autopilot is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightMode {
    /// The companion may steer: ArduCopter GUIDED, PX4 OFFBOARD.
    Guided,
    /// Holding its place: ArduCopter LOITER, POSHOLD, BRAKE; PX4 HOLD.
    Hold,
    /// Taking off by itself (PX4).
    TakeOff,
    /// Returning to launch.
    Return,
    /// Landing.
    Land,
    /// Any other, with its `custom_mode`.
    Other(u32),
}

impl FlightMode {
    /// From the heartbeat's `custom_mode`: for ArduCopter the mode number, for PX4 the main mode in bits 16..23
    /// and the sub mode in bits 24..31.
    #[must_use]
    pub const fn from_custom_mode(firmware: Firmware, custom_mode: u32) -> FlightMode {
        match (firmware, custom_mode) {
            (Firmware::ArduPilot, 4) => FlightMode::Guided,
            (Firmware::ArduPilot, 5 | 16 | 17) => FlightMode::Hold,
            (Firmware::ArduPilot, 6 | 21 | 27) => FlightMode::Return,
            (Firmware::ArduPilot, 9) => FlightMode::Land,
            (Firmware::Px4, 0x0006_0000) => FlightMode::Guided,
            (Firmware::Px4, 0x0204_0000) => FlightMode::TakeOff,
            (Firmware::Px4, 0x0304_0000) => FlightMode::Hold,
            (Firmware::Px4, 0x0504_0000) => FlightMode::Return,
            (Firmware::Px4, 0x0604_0000 | 0x0904_0000) => FlightMode::Land,
            _ => FlightMode::Other(custom_mode),
        }
    }

    /// Whether position targets are obeyed. In every other mode someone else has the vehicle.
    #[must_use]
    pub const fn companion_may_steer(self) -> bool {
        matches!(self, FlightMode::Guided)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_guided_and_offboard_let_the_companion_steer() {
        let steers = |firmware, mode| FlightMode::from_custom_mode(firmware, mode).companion_may_steer();
        let copter: std::vec::Vec<u32> = (0..64).filter(|&mode| steers(Firmware::ArduPilot, mode)).collect();
        assert_eq!(copter, [4]);
        let px4: std::vec::Vec<u32> =
            (0..=0xFFFF).map(|high| high << 16).filter(|&mode| steers(Firmware::Px4, mode)).collect();
        assert_eq!(px4, [0x0006_0000]);
        assert!(!steers(Firmware::Other(0), 4));
    }
}
