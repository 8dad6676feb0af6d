//! The simulated ArduCopter against the measurements, through its bytes only.

use super::super::testbench::{Bench, LINK};
use super::super::{AircraftFault, AutopilotKind, LinkId, VehicleMode};
use crate::wire::Speaker;
use gleaner_link::{Address, Frame};
use gleaner_units::Duration;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

/// In GUIDED at 60 m.
fn flying() -> Bench {
    let mut bench = Bench::new(AutopilotKind::ArduPilot);
    bench.run(10.0);
    bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]), Some(0));
    bench.run(35.0);
    bench.received.clear();
    bench
}

#[test]
fn unrequested_links_carry_heartbeats_texts_origin_and_home() {
    let mut bench = Bench::new(AutopilotKind::ArduPilot);
    bench.run(30.0);
    let mut ids: Vec<u32> = bench.received.iter().map(|frame| frame.message_id).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(
        ids,
        [HEARTBEAT_DATA::ID, GPS_GLOBAL_ORIGIN_DATA::ID, HOME_POSITION_DATA::ID, STATUSTEXT_DATA::ID]
    );
    assert_eq!((bench.count(GPS_GLOBAL_ORIGIN_DATA::ID), bench.count(HOME_POSITION_DATA::ID)), (1, 1));
    assert!((30..=31).contains(&bench.count(HEARTBEAT_DATA::ID)));
}

#[test]
fn requested_rates_are_exact_and_per_link() {
    let mut bench = Bench::new(AutopilotKind::ArduPilot);
    bench.run(10.0);
    assert_eq!(bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [32.0, 1e5, 0.0, 0.0]), Some(0));
    assert_eq!(bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [9000.0, 1e5, 0.0, 0.0]), Some(2));
    bench.autopilot.transmit(LinkId::GROUND);
    bench.received.clear();
    bench.run(20.0);
    assert_eq!(bench.count(LOCAL_POSITION_NED_DATA::ID), 200);
    bench.received.clear();
    bench.read(LinkId::GROUND);
    assert_eq!(bench.count(LOCAL_POSITION_NED_DATA::ID), 0);
    let asked = bench.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, [148.0, 0.0, 0.0, 0.0]);
    assert_eq!((asked, bench.count(AUTOPILOT_VERSION_DATA::ID)), (Some(0), 1));
    assert_eq!(bench.command(MavCmd::MAV_CMD_USER_5, [0.0; 4]), Some(3), "unsupported");
}

#[test]
fn arming_needs_the_estimator_and_ends_on_the_ground() {
    let mut bench = Bench::new(AutopilotKind::ArduPilot);
    bench.run(1.0);
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]), Some(4));
    assert!(bench.texts().contains(&"Arm: Need Position Estimate".to_owned()));
    bench.run(9.0);
    bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]), Some(4), "not armed");
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]), Some(0));
    bench.target([50.0, 50.0, -60.0]);
    bench.run(10.3);
    assert!(bench.truth().armed && bench.truth().on_ground, "targets do not lift it off");
    bench.run(0.2);
    assert!(!bench.truth().armed, "10.4 s");
}

#[test]
fn take_off_to_60_m_takes_29_s() {
    let mut bench = Bench::new(AutopilotKind::ArduPilot);
    bench.run(10.0);
    bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]);
    let start = bench.now;
    while bench.truth().height_m < 59.0 && bench.now - start < Duration::from_secs(60) {
        bench.run(0.02);
    }
    let seconds = (bench.now - start).as_secs_f32();
    assert!((seconds - 29.0).abs() < 0.5, "{seconds}");
}

#[test]
fn one_target_is_kept_without_a_stream() {
    let mut bench = flying();
    bench.target([32.0, -7.0, -59.5]);
    bench.run(60.0);
    let at = bench.truth().position;
    assert!((at.north_m - 32.0).abs() < 0.05 && (at.east_m + 7.0).abs() < 0.05, "{at:?}");
    assert_eq!(bench.truth().mode, VehicleMode::Guided);
}

#[test]
fn a_target_during_the_climb_replaces_the_take_off() {
    let mut bench = Bench::new(AutopilotKind::ArduPilot);
    bench.run(10.0);
    bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]);
    bench.run(10.0);
    let before = bench.truth();
    assert!(before.height_m > 5.0 && before.height_m < 30.0);
    bench.target([52.0, -7.0, -30.0]);
    bench.run(20.0);
    let at = bench.truth().position;
    assert!((at.north_m - 52.0).abs() < 0.1 && (at.down_m + 30.0).abs() < 0.3, "{at:?}");
}

#[test]
fn a_pilots_mode_stays_until_a_command() {
    let mut bench = flying();
    bench.target([212.0, -7.0, -59.5]);
    bench.run(8.0);
    let heartbeats = bench.count(HEARTBEAT_DATA::ID);
    bench.autopilot.pilot_selects(VehicleMode::Hold);
    bench.read(LINK);
    assert_eq!(bench.count(HEARTBEAT_DATA::ID), heartbeats + 1, "a heartbeat at once");
    let from = bench.truth().position;
    bench.run(10.0);
    let ignored = bench.truth().ignored_targets;
    bench.target([0.0, 0.0, -59.5]);
    bench.run(10.0);
    let truth = bench.truth();
    assert_eq!(truth.ignored_targets, ignored + 1);
    let way_m = from.horizontal_distance(&truth.position).0;
    assert!((15.0..27.0).contains(&way_m), "{way_m}");
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]), Some(0));
    bench.run(5.0);
    assert!(truth.position.horizontal_distance(&bench.truth().position).0 < 0.2, "holds");
}

#[test]
fn targets_outside_the_fence_are_ignored() {
    let mut bench = flying();
    for (name, value) in [("FENCE_ENABLE", 1.0), ("FENCE_TYPE", 2.0), ("FENCE_RADIUS", 150.0)] {
        assert!(bench.autopilot.set_parameter(name, value));
    }
    bench.target([12.0 + 149.0, -7.0, -59.5]);
    bench.run(25.0);
    let inside = bench.truth().position;
    assert!((inside.north_m - 161.0).abs() < 0.1);
    bench.received.clear();
    bench.target([12.0 + 151.0, -7.0, -59.5]);
    bench.run(5.0);
    assert!(inside.horizontal_distance(&bench.truth().position).0 < 0.1);
    assert_eq!(bench.count(COMMAND_ACK_DATA::ID) + bench.count(STATUSTEXT_DATA::ID), 0);
}

#[test]
fn a_nan_target_ends_the_simulator() {
    let mut bench = flying();
    bench.target([f32::NAN, 0.0, -59.5]);
    bench.run(3.0);
    assert!(bench.truth().killed_by_nan);
    assert!(bench.received.is_empty());
}

#[test]
fn a_reboot_forgets_mode_links_and_streams() {
    let mut bench = flying();
    bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [33.0, 1e5, 0.0, 0.0]);
    bench.target([52.0, -7.0, -59.5]);
    bench.run(3.0);
    let before = bench.truth();
    bench.autopilot.inject(AircraftFault::Reboot);
    bench.received.clear();
    bench.run(2.9);
    assert!(bench.received.is_empty(), "it boots");
    bench.run(7.0);
    let truth = bench.truth();
    assert!(truth.on_ground && !truth.armed && truth.mode == VehicleMode::Stabilize);
    assert_eq!((truth.position.north_m, truth.height_m), (before.position.north_m, 0.0));
    assert_eq!(truth.battery, before.battery);
    assert_eq!(bench.count(GLOBAL_POSITION_INT_DATA::ID), 0, "not requested since");
    assert!((7..=8).contains(&bench.count(HEARTBEAT_DATA::ID)));
    bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [33.0, 1e5, 0.0, 0.0]);
    bench.run(0.2);
    let position = bench.all::<GLOBAL_POSITION_INT_DATA>().pop().unwrap();
    assert!((9_000..11_000).contains(&position.time_boot_ms), "its clock began again: {position:?}");
}

#[test]
fn low_battery_is_reported_once_and_latched() {
    let mut bench = flying();
    bench.autopilot.inject(AircraftFault::Voltage(10.3));
    bench.run(9.8);
    assert!(bench.texts().is_empty());
    bench.run(0.4);
    let told = bench.texts();
    assert!(told[0].starts_with("Battery 1 is low 10.30V used "), "{told:?}");
    assert_eq!((told.len(), told[1].as_str()), (2, "Battery Failsafe"));
    bench.autopilot.inject(AircraftFault::Voltage(12.6));
    bench.run(30.0);
    assert_eq!(bench.truth().mode, VehicleMode::Guided, "BATT_FS_LOW_ACT 0");
    let status = bench.all::<HEARTBEAT_DATA>().last().unwrap().system_status;
    assert_eq!(status, MavState::MAV_STATE_CRITICAL);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_LAND, [0.0; 4]), Some(0));
    bench.run(80.0);
    assert!(!bench.truth().armed);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]), Some(0));
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]), Some(4));
    assert!(bench.texts().contains(&"Arm: Battery 1 low voltage failsafe".to_owned()));
}

#[test]
fn return_from_60_m_takes_about_72_s_to_disarm() {
    // How far from home the measured flight began is not known; over home it takes a minute.
    let mut bench = flying();
    bench.target([52.0, -7.0, -59.5]);
    bench.run(15.0);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, [0.0; 4]), Some(0));
    let start = bench.now;
    while bench.truth().armed && bench.now - start < Duration::from_secs(200) {
        bench.run(0.02);
    }
    let seconds = (bench.now - start).as_secs_f32();
    assert!((64.0..76.0).contains(&seconds), "{seconds}");
    assert!(bench.truth().on_ground);
}

#[test]
fn speed_changes_by_command_and_not_by_parameter() {
    let mut bench = flying();
    bench.target([412.0, -7.0, -59.5]);
    bench.run(8.0);
    bench.autopilot.set_parameter("WPNAV_SPEED", 300.0);
    bench.run(4.0);
    assert!((bench.truth().ground_speed_mps - 10.0).abs() < 0.3);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_CHANGE_SPEED, [1.0, 5.0, -1.0, 0.0]), Some(0));
    bench.run(4.0);
    assert!((bench.truth().ground_speed_mps - 5.0).abs() < 0.3);
}

#[test]
fn frames_are_routed_to_links_that_have_sent() {
    let mut bench = Bench::new(AutopilotKind::ArduPilot);
    bench.run(1.0);
    bench.send(&HEARTBEAT_DATA { autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID, ..HEARTBEAT_DATA::DEFAULT });
    let from_companion =
        |frames: &[Frame]| frames.iter().filter(|frame| frame.sender.component == 191).count();
    bench.received.clear();
    bench.read(LinkId::GROUND);
    assert_eq!(from_companion(&bench.received), 0, "nothing was received on the ground link");
    let mut ground = Speaker::new(Address::new(255, 190));
    bench.autopilot.receive(LinkId::GROUND, &ground.frame(&HEARTBEAT_DATA::DEFAULT));
    bench.send(&HEARTBEAT_DATA::DEFAULT);
    bench.read(LinkId::GROUND);
    assert_eq!(from_companion(&bench.received), 1);
    let command = COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_USER_2,
        param1: 1.0,
        target_system: 1,
        target_component: 191,
        ..COMMAND_LONG_DATA::DEFAULT
    };
    bench.received.clear();
    bench.autopilot.receive(LinkId::GROUND, &ground.frame(&command));
    bench.read(LINK);
    assert_eq!(bench.all::<COMMAND_LONG_DATA>(), std::slice::from_ref(&command));
    bench.received.clear();
    bench.read(LinkId::GROUND);
    assert_eq!(bench.count(COMMAND_ACK_DATA::ID), 0, "not for the autopilot: it does not answer");
}

#[test]
fn parameters_are_listed_read_and_set() {
    let mut bench = Bench::new(AutopilotKind::ArduPilot);
    bench.send(&PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 1 });
    bench.read(LINK);
    let listed = bench.all::<PARAM_VALUE_DATA>();
    assert_eq!(listed.len(), usize::from(listed[0].param_count));
    bench.received.clear();
    bench.send(&PARAM_SET_DATA {
        param_id: "WPNAV_SPEED".into(),
        param_value: 700.0,
        target_system: 1,
        target_component: 1,
        ..PARAM_SET_DATA::DEFAULT
    });
    bench.read(LINK);
    bench.read(LinkId::GROUND);
    bench.read(LinkId::CREW);
    let values = bench.all::<PARAM_VALUE_DATA>();
    assert_eq!(values.iter().map(|value| value.param_value).collect::<Vec<_>>(), [700.0; 3], "on every link");
}
