//! Missions that cannot be flown are refused.

use crate::rig::{TERMINAL, mission};
use gleaner_guard::GuardError;
use gleaner_pilot::{DeviceSite, Machine, Mission, MissionError};
use gleaner_units::{BatteryUnits, Cell, CellSet, GeoPoint, Grid, Metres};

#[test]
fn each_fault_of_a_mission_is_named() {
    type Spoil = fn(&mut Mission);
    let cases: [(MissionError, Spoil); 11] = [
        (MissionError::FenceGrid, |mission| {
            mission.fence = CellSet::full(Grid::new(4, 4, Metres(20.0)).unwrap());
        }),
        (MissionError::Guard(GuardError::TerminalOutsideFence), |mission| mission.fence.remove(TERMINAL)),
        (MissionError::Guard(GuardError::TerminalOutsideFence), |mission| mission.terminal = Cell::new(8, 0)),
        (MissionError::Guard(GuardError::TerminalIsolated), |mission| {
            mission.fence = CellSet::empty(mission.grid());
            mission.fence.insert(TERMINAL);
        }),
        (MissionError::Rotation, |mission| mission.pose.rotation = gleaner_units::Degrees(f32::NAN)),
        (MissionError::Corner, |mission| {
            mission.pose.corner = GeoPoint { lat_deg_e7: i32::MIN, lon_deg_e7: 0 }
        }),
        (MissionError::Budget, |mission| mission.budget = BatteryUnits(f32::NAN)),
        (MissionError::Budget, |mission| mission.budget = BatteryUnits(0.0)),
        (MissionError::DeviceOutside { id: 9 }, |mission| mission.devices[1].cell = Cell::new(0, 6)),
        (MissionError::DuplicateDevice { id: 7 }, |mission| mission.devices[1].id = 7),
        (MissionError::DeviceData { id: 7 }, |mission| mission.devices[0].data = f32::INFINITY),
    ];
    for (error, spoil) in cases {
        let mut spoilt = mission();
        spoil(&mut spoilt);
        assert_eq!(spoilt.check(), Err(error));
        assert_eq!(Machine::new(spoilt, true).err(), Some(error));
    }
}

#[test]
fn a_mission_without_devices_is_a_flight_home() {
    let mut empty = mission();
    empty.devices.clear();
    assert_eq!(empty.check(), Ok(()));
    assert_eq!(empty.initial_data(), 0.0);
    let site = DeviceSite { id: 1, cell: Cell::new(0, 0), data: 0.0 };
    empty.devices.push(site).unwrap();
    assert_eq!(empty.check(), Ok(()), "a device that holds nothing may be there");
}
