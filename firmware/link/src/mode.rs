//! Flight modes of the two autopilots, as far as a companion needs them.

/// Flight stack of the autopilot.
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

/// Whether a `MAV_TYPE` is a multirotor: quadrotor, coaxial, hexa-, octo-, tri-, dodeca- or decarotor, generic.
/// Helicopters and VTOL aircraft are not.
#[must_use]
pub const fn is_multirotor(vehicle: u8) -> bool {
    matches!(vehicle, 2 | 3 | 13..=15 | 29 | 35 | 43)
}

/// Flight mode of the autopilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightMode {
    /// The companion may steer: ArduCopter GUIDED, PX4 OFFBOARD.
    Guided,
    /// Holds its position: ArduCopter LOITER, POSHOLD, BRAKE; PX4 HOLD.
    Hold,
    /// Automatic take-off (PX4).
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
    /// and the sub mode in bits 24..31. `vehicle` is the `MAV_TYPE`: the numbers of other ArduPilot vehicles mean
    /// other modes (a plane's ACRO is a copter's GUIDED), so all modes of a vehicle that is no multirotor are
    /// [`FlightMode::Other`].
    #[must_use]
    pub const fn from_custom_mode(firmware: Firmware, vehicle: u8, custom_mode: u32) -> FlightMode {
        if !is_multirotor(vehicle) {
            return FlightMode::Other(custom_mode);
        }
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

    /// Whether position targets are obeyed. In every other mode the vehicle is not ours.
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
        let steers = |firmware, mode| FlightMode::from_custom_mode(firmware, 2, mode).companion_may_steer();
        let copter: std::vec::Vec<u32> = (0..64).filter(|&mode| steers(Firmware::ArduPilot, mode)).collect();
        assert_eq!(copter, [4]);
        let px4: std::vec::Vec<u32> =
            (0..=0xFFFF).map(|high| high << 16).filter(|&mode| steers(Firmware::Px4, mode)).collect();
        assert_eq!(px4, [0x0006_0000]);
        assert!(!steers(Firmware::Other(0), 4));
        for vehicle in (0..=255).filter(|&vehicle| !is_multirotor(vehicle)) {
            let plane = FlightMode::from_custom_mode(Firmware::ArduPilot, vehicle, 4);
            assert_eq!(plane, FlightMode::Other(4), "MAV_TYPE {vehicle}");
        }
    }
}
