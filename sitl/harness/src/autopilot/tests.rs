//! The simulated autopilot against the measurements, through its bytes only.

use super::CopterMode as Mode;
use super::*;
use crate::wire::{Speaker, parse};
use gleaner_link::Frame;
use gleaner_units::Duration;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

struct Bench {
    copter: Copter,
    now: Instant,
    speaker: Speaker,
    heard: Vec<Frame>,
}

const LINK: LinkId = LinkId::COMPANION;

impl Bench {
    fn new() -> Bench {
        let pack = Pack::new(BatteryUnits(200.0));
        let settings = CopterSettings {
            system_id: 1,
            origin: GeoPoint { lat_deg_e7: 481_000_000, lon_deg_e7: 115_000_000 },
            stand: Ned { north_m: 12.0, east_m: -7.0, down_m: 0.5 },
            pack,
            wander_m: 0.0,
            seed: 1,
        };
        let speaker = Speaker::new(Address::new(1, 191));
        Bench { copter: Copter::new(settings), now: Instant::ZERO, speaker, heard: Vec::new() }
    }

    /// In GUIDED at 60 m, with the streams that a companion asks for.
    fn flying() -> Bench {
        let mut bench = Bench::new();
        bench.run(10.0);
        bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]);
        bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]), Some(0));
        bench.run(35.0);
        bench.heard.clear();
        bench
    }

    fn send<D: MessageData>(&mut self, data: &D) {
        let bytes = self.speaker.frame(data);
        self.copter.receive(LINK, &bytes);
    }

    fn listen(&mut self, link: LinkId) {
        let mut decoder = FrameDecoder::new();
        for bytes in self.copter.transmit(link) {
            assert_eq!(decoder.push(&bytes), bytes.len());
            self.heard.extend(std::iter::from_fn(|| decoder.next_frame()));
        }
        assert_eq!(decoder.stats().garbage_bytes, 0);
    }

    fn run(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f32(seconds as f32);
        while self.now < end {
            self.now = self.now + Duration::from_millis(20);
            self.copter.step(self.now);
            self.listen(LINK);
        }
    }

    /// Parameters 1, 2, 3 and 7; the result that was acknowledged.
    fn command(&mut self, command: MavCmd, [param1, param2, param3, param7]: [f32; 4]) -> Option<u8> {
        self.send(&COMMAND_LONG_DATA {
            command,
            param1,
            param2,
            param3,
            param7,
            target_system: 1,
            target_component: 1,
            ..COMMAND_LONG_DATA::DEFAULT
        });
        self.listen(LINK);
        let ack = self.heard.iter().rfind(|frame| frame.message_id == COMMAND_ACK_DATA::ID)?;
        let id = u16::from_le_bytes([ack.payload()[0], ack.payload()[1]]);
        assert_eq!(u32::from(id), command as u32);
        Some(ack.payload()[2])
    }

    fn target(&mut self, x: f32, y: f32, z: f32) {
        self.send(&SET_POSITION_TARGET_LOCAL_NED_DATA {
            x,
            y,
            z,
            type_mask: PositionTargetTypemask::from_bits_retain(3576),
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
            target_system: 1,
            target_component: 1,
            ..SET_POSITION_TARGET_LOCAL_NED_DATA::DEFAULT
        });
    }

    fn count(&self, message_id: u32) -> usize {
        self.heard.iter().filter(|frame| frame.message_id == message_id).count()
    }

    fn all<D: MessageData>(&self) -> Vec<D> {
        self.heard.iter().filter_map(parse::<D>).collect()
    }

    fn texts(&self) -> Vec<String> {
        self.all::<STATUSTEXT_DATA>().iter().map(|text| text.text.to_str().unwrap().to_owned()).collect()
    }
}

#[test]
fn unasked_a_link_carries_heartbeats_origin_and_home_once_and_texts() {
    let mut bench = Bench::new();
    bench.run(30.0);
    let mut ids: Vec<u32> = bench.heard.iter().map(|frame| frame.message_id).collect();
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
fn asked_for_a_rate_it_gives_exactly_that_on_that_link_only() {
    let mut bench = Bench::new();
    bench.run(10.0);
    assert_eq!(bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [32.0, 1e5, 0.0, 0.0]), Some(0));
    assert_eq!(bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [9000.0, 1e5, 0.0, 0.0]), Some(2));
    bench.copter.transmit(LinkId::GROUND);
    bench.heard.clear();
    bench.run(20.0);
    assert_eq!(bench.count(LOCAL_POSITION_NED_DATA::ID), 200);
    bench.heard.clear();
    bench.listen(LinkId::GROUND);
    assert_eq!(bench.count(LOCAL_POSITION_NED_DATA::ID), 0);
    let asked = bench.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, [148.0, 0.0, 0.0, 0.0]);
    assert_eq!((asked, bench.count(AUTOPILOT_VERSION_DATA::ID)), (Some(0), 1));
    assert_eq!(bench.command(MavCmd::MAV_CMD_USER_5, [0.0; 4]), Some(3), "unsupported");
}

#[test]
fn it_does_not_arm_before_the_estimator_is_ready_nor_stay_armed_on_the_ground() {
    let mut bench = Bench::new();
    bench.run(1.0);
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]), Some(4));
    assert!(bench.texts().contains(&"Arm: Need Position Estimate".to_owned()));
    bench.run(9.0);
    bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]), Some(4), "not armed");
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]), Some(0));
    bench.target(50.0, 50.0, -60.0);
    bench.run(10.3);
    assert!(bench.copter.truth().armed && bench.copter.truth().on_ground, "targets do not lift it off");
    bench.run(0.2);
    assert!(!bench.copter.truth().armed, "10.4 s");
}

#[test]
fn take_off_to_60_m_takes_29_s() {
    let mut bench = Bench::new();
    bench.run(10.0);
    bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]);
    let start = bench.now;
    while bench.copter.truth().height_m < 59.0 && bench.now - start < Duration::from_secs(60) {
        bench.run(0.02);
    }
    let seconds = (bench.now - start).as_secs_f32();
    assert!((seconds - 29.0).abs() < 0.5, "{seconds}");
}

#[test]
fn one_target_is_enough_and_is_kept_for_ever() {
    let mut bench = Bench::flying();
    bench.target(32.0, -7.0, -59.5);
    bench.run(60.0);
    let at = bench.copter.truth().position;
    assert!((at.north_m - 32.0).abs() < 0.05 && (at.east_m + 7.0).abs() < 0.05, "{at:?}");
    assert_eq!(bench.copter.truth().mode, Mode::Guided);
}

#[test]
fn a_target_during_the_climb_replaces_the_take_off() {
    let mut bench = Bench::new();
    bench.run(10.0);
    bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]);
    bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, 60.0]);
    bench.run(10.0);
    let before = bench.copter.truth();
    assert!(before.height_m > 5.0 && before.height_m < 30.0);
    bench.target(52.0, -7.0, -30.0);
    bench.run(20.0);
    let at = bench.copter.truth().position;
    assert!((at.north_m - 52.0).abs() < 0.1 && (at.down_m + 30.0).abs() < 0.3, "{at:?}");
}

#[test]
fn the_pilot_takes_over_and_only_a_command_gives_back() {
    let mut bench = Bench::flying();
    bench.target(212.0, -7.0, -59.5);
    bench.run(8.0);
    let heartbeats = bench.count(HEARTBEAT_DATA::ID);
    bench.copter.pilot_selects(Mode::Loiter);
    bench.listen(LINK);
    assert_eq!(bench.count(HEARTBEAT_DATA::ID), heartbeats + 1, "a heartbeat at once");
    let from = bench.copter.truth().position;
    bench.run(10.0);
    let ignored = bench.copter.truth().ignored_targets;
    bench.target(0.0, 0.0, -59.5);
    bench.run(10.0);
    let truth = bench.copter.truth();
    assert_eq!(truth.ignored_targets, ignored + 1);
    let way_m = from.horizontal_distance(&truth.position).0;
    assert!((15.0..27.0).contains(&way_m), "{way_m}");
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]), Some(0));
    bench.run(5.0);
    assert!(truth.position.horizontal_distance(&bench.copter.truth().position).0 < 0.2, "holds");
}

#[test]
fn beyond_the_fence_a_target_is_silently_ignored() {
    let mut bench = Bench::flying();
    for (name, value) in [("FENCE_ENABLE", 1.0), ("FENCE_TYPE", 2.0), ("FENCE_RADIUS", 150.0)] {
        assert!(bench.copter.set_parameter(name, value));
    }
    bench.target(12.0 + 149.0, -7.0, -59.5);
    bench.run(25.0);
    let inside = bench.copter.truth().position;
    assert!((inside.north_m - 161.0).abs() < 0.1);
    bench.heard.clear();
    bench.target(12.0 + 151.0, -7.0, -59.5);
    bench.run(5.0);
    assert!(inside.horizontal_distance(&bench.copter.truth().position).0 < 0.1);
    assert_eq!(bench.count(COMMAND_ACK_DATA::ID) + bench.count(STATUSTEXT_DATA::ID), 0);
}

#[test]
fn not_a_number_ends_the_simulation() {
    let mut bench = Bench::flying();
    bench.target(f32::NAN, 0.0, -59.5);
    bench.run(3.0);
    assert!(bench.copter.truth().killed_by_nan);
    assert!(bench.heard.is_empty());
}

#[test]
fn rebooted_it_lies_below_and_knows_nobody() {
    let mut bench = Bench::flying();
    bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [33.0, 1e5, 0.0, 0.0]);
    bench.target(52.0, -7.0, -59.5);
    bench.run(3.0);
    let before = bench.copter.truth();
    bench.copter.reboot();
    bench.heard.clear();
    bench.run(2.9);
    assert!(bench.heard.is_empty(), "it boots");
    bench.run(7.0);
    let truth = bench.copter.truth();
    assert!(truth.on_ground && !truth.armed && truth.mode == Mode::Stabilize);
    assert_eq!((truth.position.north_m, truth.height_m), (before.position.north_m, 0.0));
    assert_eq!(truth.battery, before.battery);
    assert_eq!(bench.count(GLOBAL_POSITION_INT_DATA::ID), 0, "nobody has asked since");
    assert!((7..=8).contains(&bench.count(HEARTBEAT_DATA::ID)));
    bench.command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [33.0, 1e5, 0.0, 0.0]);
    bench.run(0.2);
    let position = bench.all::<GLOBAL_POSITION_INT_DATA>().pop().unwrap();
    assert!((9_000..11_000).contains(&position.time_boot_ms), "its clock began again: {position:?}");
}

#[test]
fn low_battery_is_told_once_and_latched() {
    let mut bench = Bench::flying();
    bench.copter.set_voltage(10.3);
    bench.run(9.8);
    assert!(bench.texts().is_empty());
    bench.run(0.4);
    let told = bench.texts();
    assert!(told[0].starts_with("Battery 1 is low 10.30V used "), "{told:?}");
    assert_eq!((told.len(), told[1].as_str()), (2, "Battery Failsafe"));
    bench.copter.set_voltage(12.6);
    bench.run(30.0);
    assert_eq!(bench.copter.truth().mode, Mode::Guided, "BATT_FS_LOW_ACT 0");
    let status = bench.all::<HEARTBEAT_DATA>().last().unwrap().system_status;
    assert_eq!(status, MavState::MAV_STATE_CRITICAL);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_LAND, [0.0; 4]), Some(0));
    bench.run(80.0);
    assert!(!bench.copter.truth().armed);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 4.0, 0.0, 0.0]), Some(0));
    assert_eq!(bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]), Some(4));
    assert!(bench.texts().contains(&"Arm: Battery 1 low voltage failsafe".to_owned()));
}

#[test]
fn return_from_60_m_takes_about_72_s_to_disarm() {
    // How far from home the measured flight began is not known; over home it takes a minute.
    let mut bench = Bench::flying();
    bench.target(52.0, -7.0, -59.5);
    bench.run(15.0);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, [0.0; 4]), Some(0));
    let start = bench.now;
    while bench.copter.truth().armed && bench.now - start < Duration::from_secs(200) {
        bench.run(0.02);
    }
    let seconds = (bench.now - start).as_secs_f32();
    assert!((64.0..76.0).contains(&seconds), "{seconds}");
    assert!(bench.copter.truth().on_ground);
}

#[test]
fn speed_changes_at_once_by_command_and_not_by_parameter() {
    let mut bench = Bench::flying();
    bench.target(412.0, -7.0, -59.5);
    bench.run(8.0);
    bench.copter.set_parameter("WPNAV_SPEED", 300.0);
    bench.run(4.0);
    assert!((bench.copter.truth().ground_speed_mps - 10.0).abs() < 0.3);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_CHANGE_SPEED, [1.0, 5.0, -1.0, 0.0]), Some(0));
    bench.run(4.0);
    assert!((bench.copter.truth().ground_speed_mps - 5.0).abs() < 0.3);
}

#[test]
fn ground_station_and_companion_hear_each_other_once_both_have_spoken() {
    let mut bench = Bench::new();
    bench.run(1.0);
    bench.send(&HEARTBEAT_DATA { autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID, ..HEARTBEAT_DATA::DEFAULT });
    let from_companion =
        |frames: &[Frame]| frames.iter().filter(|frame| frame.sender.component == 191).count();
    bench.heard.clear();
    bench.listen(LinkId::GROUND);
    assert_eq!(from_companion(&bench.heard), 0, "nobody has spoken on the ground link");
    let mut ground = Speaker::new(Address::new(255, 190));
    bench.copter.receive(LinkId::GROUND, &ground.frame(&HEARTBEAT_DATA::DEFAULT));
    bench.send(&HEARTBEAT_DATA::DEFAULT);
    bench.listen(LinkId::GROUND);
    assert_eq!(from_companion(&bench.heard), 1);
    let command = COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_USER_2,
        param1: 1.0,
        target_system: 1,
        target_component: 191,
        ..COMMAND_LONG_DATA::DEFAULT
    };
    bench.heard.clear();
    bench.copter.receive(LinkId::GROUND, &ground.frame(&command));
    bench.listen(LINK);
    assert_eq!(bench.all::<COMMAND_LONG_DATA>(), std::slice::from_ref(&command));
    bench.heard.clear();
    bench.listen(LinkId::GROUND);
    assert_eq!(bench.count(COMMAND_ACK_DATA::ID), 0, "not for the autopilot: it does not answer");
}

#[test]
fn parameters_are_listed_read_and_set() {
    let mut bench = Bench::new();
    bench.send(&PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 1 });
    bench.listen(LINK);
    let listed = bench.all::<PARAM_VALUE_DATA>();
    assert_eq!(listed.len(), usize::from(listed[0].param_count));
    bench.heard.clear();
    bench.send(&PARAM_SET_DATA {
        param_id: "WPNAV_SPEED".into(),
        param_value: 700.0,
        target_system: 1,
        target_component: 1,
        ..PARAM_SET_DATA::DEFAULT
    });
    bench.listen(LINK);
    bench.listen(LinkId::GROUND);
    bench.listen(LinkId::CREW);
    let values = bench.all::<PARAM_VALUE_DATA>();
    assert_eq!(values.iter().map(|value| value.param_value).collect::<Vec<_>>(), [700.0; 3], "on every link");
}
