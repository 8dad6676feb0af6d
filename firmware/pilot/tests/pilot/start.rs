//! From boot to engaged: what holds a start back, and the states that fly nothing.

use crate::rig::{CORNER, HOME_DOWN_M, Rig, mission};
use gleaner_link::{Firmware, FlightMode, SystemState};
use gleaner_pilot::{Fault, Missing, Request, State, Vehicle};
use gleaner_units::{Action, BatteryUnits, Cell, GeoPoint, Metres, Ned};

use Action::North;

#[test]
fn nothing_happens_without_a_request() {
    let mut rig = Rig::new();
    assert_eq!(rig.state(), State::Boot);
    assert_eq!(rig.machine.system_state(), SystemState::Boot);
    rig.run(5.0);
    assert_eq!(rig.state(), State::Idle);
    assert!(rig.setpoints.is_empty() && rig.commands.is_empty() && rig.policy.asked.is_empty());
    assert_eq!(rig.machine.system_state(), SystemState::Standby);
}

#[test]
fn a_failed_self_test_refuses_every_request_for_good() {
    let mut rig = Rig::with(mission(), false);
    for request in [None, Some(Request::Engage), Some(Request::Shadow), Some(Request::Off)] {
        rig.request = request;
        rig.step();
        assert_eq!(rig.state(), State::Fault);
    }
    assert_eq!(rig.machine.fault(), Some(Fault::SelfTest));
    assert!(!rig.machine.may_engage());
    assert_eq!(rig.machine.system_state(), SystemState::Critical);
    rig.run(5.0);
    assert!(rig.setpoints.is_empty() && rig.commands.is_empty());
    assert_eq!(rig.said("self-test failed"), 4);
}

#[test]
fn each_missing_condition_holds_the_start_back_and_is_told_once() {
    type Spoil = fn(&mut Rig);
    let cases: [(Missing, Spoil); 15] = [
        (Missing::Permission, |rig| rig.engage_inhibited = true),
        (Missing::Autopilot, |rig| rig.vehicle.mode = None),
        (Missing::Heartbeat, |rig| rig.beats = false),
        (Missing::Origin, |rig| rig.vehicle.origin = None),
        (Missing::Position, |rig| rig.vehicle.position = None),
        (Missing::Position, |rig| rig.vehicle.position = Some(Ned { north_m: f32::NAN, ..Ned::default() })),
        (Missing::Estimator, |rig| rig.vehicle.ready = false),
        (Missing::Home, |rig| rig.vehicle.home_down_m = None),
        (Missing::Battery, |rig| rig.vehicle.battery_percent = None),
        (Missing::Radio, |rig| rig.radio_reports = false),
        (Missing::Armed, |rig| rig.vehicle.armed = false),
        (Missing::GuidedMode, |rig| rig.vehicle.mode = Some(FlightMode::Hold)),
        (Missing::Altitude, |rig| rig.set("GLN_ALT", 64.0)),
        (Missing::InsideFence, |rig| rig.place(Cell::new(3, 3), 0.0)),
        (Missing::EnoughBattery, |rig| rig.set("GLN_RESERVE", 22.5)),
    ];
    for (missing, spoil) in cases {
        let mut rig = Rig::new();
        spoil(&mut rig);
        rig.request = Some(Request::Engage);
        rig.run(10.0);
        assert_eq!((rig.state(), rig.machine.missing()), (State::Waiting, Some(missing)));
        let told = if missing == Missing::EnoughBattery { "way home needs 30.5" } else { missing.text() };
        assert_eq!(rig.said(told), 1, "{missing:?}: {:?}", rig.texts);
        assert!(rig.setpoints.is_empty() && rig.commands.is_empty() && rig.policy.asked.is_empty());
    }
}

#[test]
fn an_aircraft_outside_the_grid_is_told_the_distance() {
    let north = |metres: f32| CORNER.offset_by(Metres(-metres), Metres(0.0));
    for (origin, told) in [
        (north(50.0), "waiting: 50 m outside the grid"),
        (north(2400.0), "waiting: 2 km outside the grid"),
        (GeoPoint { lat_deg_e7: 353_632_621, ..CORNER }, " km outside the grid"),
    ] {
        let mut rig = Rig::new();
        rig.vehicle.origin = Some(origin);
        rig.vehicle.position = Some(Ned { down_m: HOME_DOWN_M - 60.0, ..Ned::default() });
        rig.request = Some(Request::Engage);
        rig.run(3.0);
        assert_eq!(rig.machine.missing(), Some(Missing::InsideFence));
        assert_eq!(rig.said(told), 1, "{:?}", rig.texts);
    }
}

#[test]
fn the_inhibit_input_does_not_end_an_engaged_mission() {
    let mut rig = Rig::engaged();
    rig.engage_inhibited = true;
    rig.run(10.0);
    assert_eq!(rig.state(), State::Engaged);
}

#[test]
fn an_altitude_below_the_buildings_is_refused() {
    let mut mission = mission();
    mission.heights.set(Cell::new(4, 4), 60);
    let mut rig = Rig::with(mission, true);
    rig.request = Some(Request::Engage);
    rig.step();
    assert_eq!(rig.machine.missing(), Some(Missing::SafeAltitude));
}

#[test]
fn the_start_waits_for_the_last_condition_and_tells_each_change() {
    let mut rig = Rig::new();
    rig.vehicle.armed = false;
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.request = Some(Request::Engage);
    rig.run(3.0);
    rig.vehicle.armed = true;
    rig.run(3.0);
    assert_eq!(rig.machine.missing(), Some(Missing::GuidedMode));
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.step();
    assert_eq!(rig.state(), State::Engaged);
    assert_eq!((rig.said("not armed"), rig.said("mode is not"), rig.said("engaged at (1, 1)")), (1, 1, 1));
    assert_eq!(rig.machine.system_state(), SystemState::Active);
}

#[test]
fn px4_gets_a_stream_before_offboard_and_ten_a_second_in_flight() {
    let mut rig = Rig::new();
    rig.vehicle.firmware = Some(Firmware::Px4);
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.run(1.0);
    assert!(rig.setpoints.is_empty(), "not before a request");
    rig.request = Some(Request::Engage);
    rig.run(2.0);
    assert_eq!(rig.state(), State::Waiting);
    assert_eq!(rig.setpoints.last().unwrap().1, rig.vehicle.position.unwrap(), "where it is");
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.policy.then = North;
    rig.run(10.0);
    assert_eq!(rig.state(), State::Engaged);
    assert!(rig.setpoints.windows(2).all(|pair| pair[1].0 - pair[0].0 <= 100));
    assert!(rig.commands.is_empty(), "PX4 has no use for the speed command");
}

#[test]
fn shadow_decides_and_commands_nothing() {
    let mut rig = Rig::new();
    rig.vehicle.firmware = Some(Firmware::Px4);
    rig.request = Some(Request::Shadow);
    rig.run(0.1);
    assert_eq!(rig.state(), State::Shadow);
    rig.run(3.0);
    let in_place = rig.actions.len();
    assert_eq!(in_place, 2, "one at once, one after a slot of 2 s");
    rig.place(Cell::new(2, 1), 12.0);
    rig.step();
    assert_eq!(rig.actions.len(), in_place, "not at the centre");
    rig.place(Cell::new(2, 1), 1.0);
    rig.step();
    assert_eq!(rig.actions.len(), in_place + 1);
    let decision = rig.machine.decision().unwrap();
    assert_eq!((decision.state, decision.cell), (State::Shadow, Cell::new(2, 1)));
    assert_eq!(decision.battery, BatteryUnits(30.0), "the measured charge within the budget");
    rig.policy.fails = true;
    rig.run(10.0);
    assert_eq!(rig.said("policy failed"), 1, "reported once");
    assert!(rig.setpoints.is_empty() && rig.commands.is_empty());
}

#[test]
fn an_aircraft_that_was_never_heard_is_not_flown() {
    let mut rig = Rig::new();
    rig.vehicle = Vehicle::default();
    rig.request = Some(Request::Engage);
    rig.run(5.0);
    assert_eq!(rig.machine.missing(), Some(Missing::Autopilot));
}
