//! The simulated PX4 against the measurements, through its bytes only.

use super::super::testbench::{Bench, LINK};
use super::super::{AircraftFault, AutopilotKind, Commander, LinkId, VehicleMode};
use gleaner_units::{BatteryUnits, Duration};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

const ACCEPTED: Option<u8> = Some(0);
const TEMPORARILY_REJECTED: Option<u8> = Some(1);
/// 584 m above sea level is the origin; the stand is 0.5 m below it.
const AMSL_60_M: f32 = 584.0 - 0.5 + 60.0;
const OFFBOARD: [f32; 4] = [1.0, 6.0, 0.0, 0.0];
const HOLD: [f32; 4] = [1.0, 4.0, 3.0, 0.0];
/// Above the stand at 60 m.
const ABOVE: [f32; 3] = [12.0, -7.0, -59.5];

fn booted() -> Bench {
    let mut bench = Bench::new(AutopilotKind::Px4);
    bench.run(10.0);
    bench
}

/// In HOLD at 60 m.
fn holding() -> Bench {
    let mut bench = booted();
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]), ACCEPTED);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, AMSL_60_M]), ACCEPTED);
    bench.run(40.0);
    assert_eq!(bench.truth().mode, VehicleMode::Hold);
    bench.received.clear();
    bench
}

/// In OFFBOARD at 60 m, with a stream.
fn offboard() -> Bench {
    let mut bench = holding();
    bench.stream(0.5, ABOVE);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, OFFBOARD), ACCEPTED);
    bench.stream(0.5, ABOVE);
    assert_eq!(bench.truth().mode, VehicleMode::Guided);
    bench.received.clear();
    bench
}

#[test]
fn streams_come_unasked_at_the_measured_rates() {
    let mut bench = booted();
    bench.received.clear();
    bench.run(20.0);
    let rates = [
        (LOCAL_POSITION_NED_DATA::ID, 600),
        (SYS_STATUS_DATA::ID, 100),
        (EXTENDED_SYS_STATE_DATA::ID, 100),
        (BATTERY_STATUS_DATA::ID, 10),
        (HOME_POSITION_DATA::ID, 10),
        (GPS_RAW_INT_DATA::ID, 160),
        (HEARTBEAT_DATA::ID, 20),
    ];
    for (message_id, count) in rates {
        assert!(
            bench.count(message_id).abs_diff(count) <= 1 + count / 50,
            "{message_id}: {}",
            bench.count(message_id)
        );
    }
    assert_eq!(bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [32.0, 250_000.0, 0.0, 0.0]), ACCEPTED);
    bench.received.clear();
    bench.run(20.0);
    assert_eq!(bench.count(LOCAL_POSITION_NED_DATA::ID), 80, "4 Hz");
}

#[test]
fn take_off_altitude_is_above_sea_level() {
    let mut bench = booted();
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, AMSL_60_M]);
    let seconds = bench.run_until(60.0, |truth| truth.height_m > 59.0);
    assert!((seconds - 30.3).abs() < 1.0, "{seconds}");
    bench.run(5.0);
    assert_eq!(bench.truth().mode, VehicleMode::Hold, "take-off ends in HOLD");
    // 60 m taken for an altitude above sea level is deep underground.
    let mut bench = booted();
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]);
    bench.run(20.0);
    assert!(bench.truth().height_m < 1.0);
}

#[test]
fn offboard_in_the_air_needs_a_stream_first() {
    let mut bench = holding();
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, OFFBOARD), TEMPORARILY_REJECTED);
    assert_eq!(bench.truth().mode, VehicleMode::Hold);
    bench.stream(0.3, ABOVE);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, OFFBOARD), ACCEPTED);
}

#[test]
fn offboard_disarmed_is_accepted_without_a_stream() {
    let mut bench = booted();
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, OFFBOARD), ACCEPTED);
    assert_eq!(
        bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]),
        TEMPORARILY_REJECTED
    );
}

#[test]
fn armed_in_offboard_with_a_stream_it_takes_off() {
    let mut bench = booted();
    bench.stream(0.5, [12.0, -7.0, -19.5]);
    bench.command(MavCmd::MAV_CMD_DO_SET_MODE, OFFBOARD);
    bench.stream(0.1, [12.0, -7.0, -19.5]);
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]), ACCEPTED);
    bench.stream(20.0, [12.0, -7.0, -19.5]);
    assert!((bench.truth().height_m - 20.0).abs() < 1.0, "{}", bench.truth().height_m);
}

#[test]
fn silence_ends_offboard_with_a_failsafe_return() {
    let mut bench = offboard();
    let seconds = bench.run_until(5.0, |truth| truth.mode != VehicleMode::Guided);
    assert!((seconds - 1.35).abs() < 0.15, "{seconds}");
    assert_eq!((bench.truth().mode, bench.truth().mode_by), (VehicleMode::Return, Commander::Autopilot));
    bench.run(1.1);
    let status = bench.all::<HEARTBEAT_DATA>().last().unwrap().system_status;
    assert_eq!(status, MavState::MAV_STATE_CRITICAL);
}

#[test]
fn silence_holds_with_com_obl_rc_act_5() {
    let mut bench = offboard();
    bench.autopilot.set_parameter("COM_OBL_RC_ACT", 5.0);
    bench.run(2.0);
    assert_eq!(bench.truth().mode, VehicleMode::Hold);
}

#[test]
fn two_hertz_keep_offboard() {
    let mut bench = offboard();
    for _ in 0..20 {
        bench.target(ABOVE);
        bench.run(0.5);
    }
    assert_eq!(bench.truth().mode, VehicleMode::Guided);
}

#[test]
fn resuming_targets_return_to_offboard_after_a_failsafe() {
    let mut bench = offboard();
    bench.run(3.0);
    assert_eq!(bench.truth().mode, VehicleMode::Return);
    bench.stream(0.1, ABOVE);
    assert_eq!(bench.truth().mode, VehicleMode::Guided);
    bench.stream(2.0, ABOVE);
    let status = bench.all::<HEARTBEAT_DATA>().last().unwrap().system_status;
    assert_eq!(status, MavState::MAV_STATE_ACTIVE, "the failsafe is over");
}

#[test]
fn resuming_targets_do_not_end_a_pilots_hold() {
    let mut bench = offboard();
    bench.run(3.0);
    bench.autopilot.pilot_selects(VehicleMode::Hold);
    bench.stream(3.0, ABOVE);
    assert_eq!(bench.truth().mode, VehicleMode::Hold);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, OFFBOARD), ACCEPTED, "but a command does");
}

#[test]
fn a_mode_change_waits_for_the_next_heartbeat() {
    let mut bench = offboard();
    let heartbeats = bench.count(HEARTBEAT_DATA::ID);
    bench.autopilot.pilot_selects(VehicleMode::Hold);
    bench.read(LINK);
    assert_eq!(bench.count(HEARTBEAT_DATA::ID), heartbeats);
    bench.run(1.1);
    let mode = bench.all::<HEARTBEAT_DATA>().last().unwrap().custom_mode;
    assert_eq!(mode, 0x0304_0000);
}

#[test]
fn change_speed_is_accepted_without_effect() {
    let mut bench = offboard();
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_CHANGE_SPEED, [1.0, 3.0, -1.0, 0.0]), ACCEPTED);
    bench.stream(10.0, [212.0, -7.0, -59.5]);
    assert!(bench.truth().ground_speed_mps > 9.0, "{}", bench.truth().ground_speed_mps);
    bench.autopilot.set_parameter("MPC_XY_VEL_MAX", 4.2);
    bench.stream(5.0, [212.0, -7.0, -59.5]);
    assert!((bench.truth().ground_speed_mps - 4.2).abs() < 0.2, "{}", bench.truth().ground_speed_mps);
}

#[test]
#[expect(deprecated, reason = "companions still send the frame")]
fn frame_9_is_unsupported_and_holds() {
    let mut bench = offboard();
    let before = bench.truth().position;
    bench.autopilot.transmit(LinkId::GROUND);
    bench.target_in(MavFrame::MAV_FRAME_BODY_OFFSET_NED, [20.0, 0.0, 0.0]);
    bench.run(0.5);
    assert!(before.horizontal_distance(&bench.truth().position).0 < 0.2);
    assert!(bench.texts().is_empty(), "no text reaches the companion link");
    bench.read(LinkId::GROUND);
    assert_eq!(bench.texts(), ["coordinate frame 9 unsupported"]);
}

#[test]
fn a_nan_axis_drifts_in_offboard() {
    let mut bench = offboard();
    let before = bench.truth().position;
    bench.stream(4.0, [f32::NAN, -7.0, -59.5]);
    let truth = bench.truth();
    let drift_m = before.horizontal_distance(&truth.position).0;
    assert!((1.5..3.5).contains(&drift_m), "{drift_m}");
    assert_eq!((truth.mode, truth.killed_by_nan), (VehicleMode::Guided, false));
}

#[test]
fn integer_parameters_travel_as_bits() {
    let mut bench = booted();
    bench.received.clear();
    bench.send(&PARAM_SET_DATA {
        param_id: "COM_OBL_RC_ACT".into(),
        param_value: f32::from_bits(5),
        param_type: MavParamType::MAV_PARAM_TYPE_INT32,
        target_system: 1,
        target_component: 1,
    });
    bench.read(LINK);
    let value = bench.all::<PARAM_VALUE_DATA>().pop().unwrap();
    assert_eq!((value.param_value.to_bits(), value.param_type), (5, MavParamType::MAV_PARAM_TYPE_INT32));
    // The same number as a float has the wrong type.
    bench.send(&PARAM_SET_DATA {
        param_id: "COM_OBL_RC_ACT".into(),
        param_value: 0.0,
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        target_system: 1,
        target_component: 1,
    });
    bench.read(LINK);
    assert_eq!(bench.all::<PARAM_VALUE_DATA>().pop().unwrap().param_value.to_bits(), 5);
}

#[test]
fn battery_levels_warn_return_and_land() {
    let mut bench = offboard();
    let left = |bench: &Bench| bench.truth().battery.0;
    let drain_to = |bench: &mut Bench, units: f32| {
        let lost = BatteryUnits(left(bench) - units);
        bench.autopilot.inject(AircraftFault::ChargeLost(lost));
        bench.stream(0.5, ABOVE);
    };
    drain_to(&mut bench, 29.0);
    assert_eq!(bench.truth().mode, VehicleMode::Guided, "15 %: a warning");
    drain_to(&mut bench, 13.0);
    assert_eq!(bench.truth().mode, VehicleMode::Return, "7 %");
    drain_to(&mut bench, 9.0);
    assert_eq!(bench.truth().mode, VehicleMode::Land, "5 %");
}

#[test]
fn after_landing_it_stays_in_offboard_and_refuses_arming() {
    let mut bench = offboard();
    let below = [12.0, -7.0, 5.0];
    let start = bench.now;
    while bench.truth().armed && bench.now - start < Duration::from_secs(120) {
        bench.stream(0.1, below);
    }
    assert_eq!((bench.truth().armed, bench.truth().mode), (false, VehicleMode::Guided));
    bench.run(3.0);
    let arm = [1.0, 0.0, 0.0, 0.0];
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, arm), TEMPORARILY_REJECTED);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, HOLD), ACCEPTED);
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, arm), ACCEPTED);
}

#[test]
fn landing_from_60_m_takes_54_s() {
    let mut bench = holding();
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_LAND, [0.0; 4]), ACCEPTED);
    let seconds = bench.run_until(120.0, |truth| !truth.armed);
    assert!((seconds - 54.0).abs() < 3.0, "{seconds}");
}

#[test]
fn the_heading_is_kept() {
    let mut bench = offboard();
    bench.stream(8.0, [12.0, 60.0, -59.5]);
    assert!(bench.all::<ATTITUDE_DATA>().last().unwrap().yaw.abs() < 0.01);
}
