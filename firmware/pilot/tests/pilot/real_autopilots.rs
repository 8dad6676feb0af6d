//! What flights against the autopilots' own simulators showed, each as a test.

// Whether a message has fields beyond those named here depends on a feature of the MAVLink crate (extensions),
// which another member of the workspace may switch on.
#![allow(clippy::needless_update)]

use crate::bench::{AUTOPILOT, Bench, STATION};
use crate::rig::{Rig, TERMINAL};
use gleaner_link::{Firmware, FlightMode};
use gleaner_pilot::{Request, State};
use gleaner_units::Action;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::MavCmd;

/// With the downlink cut, targets end 2.5 s after the last heartbeat, and the aircraft is still ours when it is back.
#[test]
fn targets_end_when_the_last_heartbeat_is_old() {
    for firmware in [Firmware::ArduPilot, Firmware::Px4] {
        let mut rig = Rig::new();
        rig.vehicle.firmware = Some(firmware);
        rig.policy.then = Action::East;
        rig.engage();
        rig.run(4.0);
        rig.beats = false;
        let last_beat = rig.vehicle.heartbeat_at.unwrap().as_millis();
        rig.run(4.5);
        let last_target = rig.setpoints.last().unwrap().0;
        assert!((2_300..=2_500).contains(&(last_target - last_beat)), "{} ms", last_target - last_beat);
        let speed = rig.velocities.last().unwrap().1.unwrap_or_default();
        let before = rig.velocities.iter().rfind(|(at_ms, _)| *at_ms <= last_beat + 1_500).unwrap().1;
        assert!(speed.east_mps < before.unwrap().east_mps - 2.0, "it brakes after 1.5 s");
        rig.beats = true;
        rig.run(1.0);
        assert_eq!(rig.state(), State::Engaged, "{:?}", rig.texts);
        assert!(rig.setpoints.last().unwrap().0 > last_target);
    }
}

/// PX4 stays in OFFBOARD if the operator switched back while it landed; the next arming is refused there.
#[test]
fn px4_in_offboard_after_the_landing_is_reported() {
    for (firmware, reported) in [(Firmware::Px4, 1), (Firmware::ArduPilot, 0)] {
        let mut rig = Rig::new();
        rig.vehicle.firmware = Some(firmware);
        rig.place(TERMINAL, 0.0);
        rig.engage();
        rig.request = Some(Request::Return);
        rig.run_to(State::Done);
        rig.vehicle.mode = Some(FlightMode::Guided);
        rig.vehicle.armed = false;
        rig.run(1.0);
        assert!(rig.machine.landed());
        assert_eq!(rig.said("leave OFFBOARD before arming again"), reported);
    }
}

fn intervals(bench: &Bench, message_id: u32) -> usize {
    let asked = bench.all::<dialect::COMMAND_LONG_DATA>();
    let is = |asked: &&dialect::COMMAND_LONG_DATA| {
        asked.command == MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL && asked.param1 == message_id as f32
    };
    asked.iter().filter(is).count()
}

#[test]
fn rc_channels_are_requested_only_when_one_is_mapped() {
    let mut bench = Bench::new(Ok(()));
    bench.run(20);
    assert_eq!(intervals(&bench, dialect::RC_CHANNELS_DATA::ID), 0);
    assert!(intervals(&bench, dialect::LOCAL_POSITION_NED_DATA::ID) > 0);
    let set = dialect::PARAM_SET_DATA {
        param_value: 6.0,
        target_system: bench.onboard.link().address().system,
        target_component: 191,
        param_id: "GLN_W_RC".into(),
        ..dialect::PARAM_SET_DATA::DEFAULT
    };
    bench.hear(STATION, &set);
    bench.run(20);
    assert!(intervals(&bench, dialect::RC_CHANNELS_DATA::ID) > 0);
}

#[test]
fn the_reason_of_a_take_over_is_repeated_after_the_autopilot_rebooted() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.mode = 5;
    bench.heartbeat();
    bench.run(2);
    assert_eq!(bench.onboard.state(), State::Passive);
    bench.sent.clear();
    let position =
        dialect::LOCAL_POSITION_NED_DATA { time_boot_ms: 7, ..dialect::LOCAL_POSITION_NED_DATA::DEFAULT };
    bench.hear(AUTOPILOT, &position);
    for _ in 0..20 {
        bench.onboard.poll(bench.now);
        bench.carry_away();
        bench.now = bench.now + gleaner_units::Duration::from_millis(50);
    }
    assert!(bench.texts().iter().any(|text| text.contains("passive, ")), "{:?}", bench.texts());
}

/// A ground station's target in GUIDED is reported by the autopilot before the next of ours replaces it.
#[test]
fn a_target_of_a_station_between_two_of_ours_is_seen() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.run(3);
    let report = |bench: &mut Bench, target: gleaner_units::Ned| {
        let data = dialect::POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms: bench.now.as_boot_ms(),
            coordinate_frame: dialect::MavFrame::MAV_FRAME_LOCAL_NED,
            type_mask: dialect::PositionTargetTypemask::from_bits_retain(0x0DC0),
            x: target.north_m,
            y: target.east_m,
            z: target.down_m,
            ..dialect::POSITION_TARGET_LOCAL_NED_DATA::DEFAULT
        };
        bench.hear(AUTOPILOT, &data);
    };
    for _ in 0..20 {
        let target = bench.target.unwrap();
        report(&mut bench, target);
        bench.tick();
    }
    assert_eq!(bench.onboard.state(), State::Engaged, "our own targets");
    let theirs = gleaner_units::Ned { north_m: 300.0, ..bench.target.unwrap() };
    report(&mut bench, theirs);
    bench.sent.clear();
    bench.tick();
    assert_eq!(bench.onboard.state(), State::Passive);
    assert!(bench.all::<dialect::SET_POSITION_TARGET_LOCAL_NED_DATA>().is_empty());
}
