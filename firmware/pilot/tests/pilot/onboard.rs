//! The whole pilot from outside: MAVLink and radio bytes in, MAVLink bytes out.

// Whether a message has fields beyond those named here depends on a feature of the MAVLink crate (extensions),
// which another member of the workspace may switch on.
#![allow(clippy::needless_update)]

use crate::rig::{CORNER, HOME_DOWN_M, START, Scripted, TERMINAL, mission};
use gleaner_link::{Component, FrameDecoder, TUNNEL_DECISION, TUNNEL_RADIO_REPORT};
use gleaner_pilot::{DecisionRecord, Onboard, OnboardError, Parameters, Settings, State};
use gleaner_policy::SelfTestError;
use gleaner_radio::{Report, encode, encode_body};
use gleaner_units::{Action, Cell, Db, Duration, Instant, Metres, Ned};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::{MavAutopilot, MavCmd, MavModeFlag, MavResult, MavState, MavType};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion};

const AUTOPILOT: (u8, u8) = (3, 1);
const STATION: (u8, u8) = (255, 190);
const ORIGIN_AMSL_MM: i32 = 584_000;

/// A policy that only hovers.
fn hovering() -> Scripted {
    Scripted { actions: Default::default(), then: Action::Hover, fails: false, logit: 1.0, asked: Vec::new() }
}

/// An ArduCopter that hovers in GUIDED at the start, and everything that came from the pilot.
struct Bench {
    onboard: Onboard<Scripted>,
    now: Instant,
    mode: u32,
    armed: bool,
    position: Ned,
    target: Option<Ned>,
    sent: Vec<gleaner_link::Frame>,
    decoder: FrameDecoder,
}

impl Bench {
    fn new(self_test: Result<(), SelfTestError>) -> Bench {
        let mut parameters = Parameters::default();
        parameters.set("GLN_ENABLE", 1.0).unwrap();
        let onboard =
            Onboard::new(mission(), parameters, Settings::default(), hovering(), self_test).unwrap();
        let position = Bench::centre(START);
        Bench {
            onboard,
            now: Instant::ZERO,
            mode: 4,
            armed: true,
            position,
            target: None,
            sent: Vec::new(),
            decoder: FrameDecoder::new(),
        }
    }

    fn origin() -> gleaner_units::GeoPoint {
        CORNER.offset_by(Metres(-100.0), Metres(50.0))
    }

    fn centre(cell: Cell) -> Ned {
        gleaner_units::GridFrame::new(mission().grid(), CORNER, Bench::origin())
            .centre(cell, HOME_DOWN_M - 60.0)
    }

    fn hear<D: MessageData>(&mut self, (system_id, component_id): (u8, u8), data: &D) {
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.serialize_message_data(
            MavHeader { system_id: system_id.into(), component_id, sequence: 0 },
            data,
        );
        self.onboard.receive_link(self.now, raw.raw_bytes());
    }

    fn command(&mut self, command: MavCmd, param1: f32) {
        let data = dialect::COMMAND_LONG_DATA {
            command,
            param1,
            target_system: self.onboard.link().address().system,
            target_component: 191,
            ..dialect::COMMAND_LONG_DATA::DEFAULT
        };
        self.hear(STATION, &data);
    }

    fn heartbeat(&mut self) {
        let mut base_mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        if self.armed {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        }
        let data = dialect::HEARTBEAT_DATA {
            custom_mode: self.mode,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode,
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        };
        self.hear(AUTOPILOT, &data);
    }

    fn streams(&mut self) {
        let Ned { north_m, east_m, down_m } = self.position;
        let time_boot_ms = self.now.as_boot_ms();
        let position = dialect::LOCAL_POSITION_NED_DATA {
            time_boot_ms,
            x: north_m,
            y: east_m,
            z: down_m,
            ..dialect::LOCAL_POSITION_NED_DATA::DEFAULT
        };
        self.hear(AUTOPILOT, &position);
        if !self.now.as_millis().is_multiple_of(1_000) {
            return;
        }
        self.heartbeat();
        let origin = Bench::origin();
        let global = dialect::GPS_GLOBAL_ORIGIN_DATA {
            latitude: origin.lat_deg_e7,
            longitude: origin.lon_deg_e7,
            altitude: ORIGIN_AMSL_MM,
            ..dialect::GPS_GLOBAL_ORIGIN_DATA::DEFAULT
        };
        self.hear(AUTOPILOT, &global);
        let home = dialect::HOME_POSITION_DATA {
            latitude: origin.lat_deg_e7,
            longitude: origin.lon_deg_e7,
            altitude: ORIGIN_AMSL_MM - (HOME_DOWN_M * 1e3) as i32,
            ..dialect::HOME_POSITION_DATA::DEFAULT
        };
        self.hear(AUTOPILOT, &home);
        let ekf = dialect::EKF_STATUS_REPORT_DATA {
            flags: dialect::EkfStatusFlags::from_bits_retain(0x33F),
            ..dialect::EKF_STATUS_REPORT_DATA::DEFAULT
        };
        self.hear(AUTOPILOT, &ekf);
        let battery =
            dialect::BATTERY_STATUS_DATA { battery_remaining: 90, ..dialect::BATTERY_STATUS_DATA::DEFAULT };
        self.hear(AUTOPILOT, &battery);
    }

    /// 100 ms of autopilot, two polls of the pilot.
    fn tick(&mut self) {
        self.streams();
        for _ in 0..2 {
            self.onboard.poll(self.now);
            self.carry_away();
            self.now = self.now + Duration::from_millis(50);
        }
        if let (Some(target), 4) = (self.target, self.mode) {
            let share = (1.0 / self.position.horizontal_distance(&target).0.max(1e-3)).min(1.0);
            self.position.north_m += (target.north_m - self.position.north_m) * share;
            self.position.east_m += (target.east_m - self.position.east_m) * share;
        }
    }

    fn run(&mut self, secs: u64) {
        for _ in 0..secs * 10 {
            self.tick();
        }
    }

    fn carry_away(&mut self) {
        let mut buffer = [0; 512];
        loop {
            let used = self.onboard.transmit(&mut buffer);
            if used == 0 {
                return;
            }
            let mut bytes = &buffer[..used];
            while !bytes.is_empty() {
                bytes = &bytes[self.decoder.push(bytes)..];
                while let Some(frame) = self.decoder.next_frame() {
                    self.obey(&frame);
                    self.sent.push(frame);
                }
            }
        }
    }

    fn obey(&mut self, frame: &gleaner_link::Frame) {
        if frame.message_id == dialect::SET_POSITION_TARGET_LOCAL_NED_DATA::ID {
            let data: dialect::SET_POSITION_TARGET_LOCAL_NED_DATA = parse(frame);
            assert_eq!((data.target_system, data.target_component), AUTOPILOT);
            self.target = Some(Ned { north_m: data.x, east_m: data.y, down_m: data.z });
        }
        if frame.message_id == dialect::COMMAND_LONG_DATA::ID {
            let data: dialect::COMMAND_LONG_DATA = parse(frame);
            if data.command == MavCmd::MAV_CMD_NAV_LAND {
                self.mode = 9;
            }
            let ack = dialect::COMMAND_ACK_DATA {
                command: data.command,
                result: MavResult::MAV_RESULT_ACCEPTED,
                ..dialect::COMMAND_ACK_DATA::DEFAULT
            };
            self.hear(AUTOPILOT, &ack);
        }
    }

    fn all<D: MessageData>(&self) -> Vec<D> {
        self.sent.iter().filter(|frame| frame.message_id == D::ID).map(parse).collect()
    }

    fn texts(&self) -> Vec<String> {
        let text = |data: dialect::STATUSTEXT_DATA| data.text.to_str().unwrap_or_default().to_owned();
        self.all().into_iter().map(text).collect()
    }

    fn records(&self) -> Vec<DecisionRecord> {
        let tunnels = self.sent.iter().filter(|frame| frame.message_id == dialect::TUNNEL_DATA::ID);
        let record = |frame: &gleaner_link::Frame| {
            // Payload type, target, length, then the record; the dialect's type refuses numbers for local use.
            let bytes = frame.payload();
            assert_eq!(u16::from_le_bytes([bytes[0], bytes[1]]), TUNNEL_DECISION);
            let mut record = bytes[5..].to_vec();
            record.resize(usize::from(bytes[4]), 0);
            DecisionRecord::decode(&record).expect("a record")
        };
        tunnels.map(record).collect()
    }

    fn engage(&mut self) {
        self.run(8);
        self.command(MavCmd::MAV_CMD_USER_2, 1.0);
        // A heartbeat after the request.
        while self.onboard.state() != State::Engaged && self.now < Instant::from_millis(20_000) {
            self.tick();
        }
        assert_eq!(
            self.onboard.state(),
            State::Engaged,
            "{:?} {:?}",
            self.onboard.stats().missing,
            self.texts()
        );
    }
}

fn parse<D: MessageData>(frame: &gleaner_link::Frame) -> D {
    D::deser(MavlinkVersion::V2, frame.payload()).unwrap()
}

#[test]
fn a_mission_is_flown_from_bytes_to_bytes() {
    let mut bench = Bench::new(Ok(()));
    bench.run(8);
    assert_eq!(bench.onboard.state(), State::Idle, "GLN_ENABLE of a settings file engages nothing");
    assert!(bench.all::<dialect::SET_POSITION_TARGET_LOCAL_NED_DATA>().is_empty());
    bench.engage();
    bench.run(5);
    bench.command(MavCmd::MAV_CMD_USER_1, 0.25);
    bench.run(5);
    bench.command(MavCmd::MAV_CMD_USER_3, 0.0);
    bench.run(30);
    assert_eq!(bench.onboard.state(), State::Done, "{:?}", bench.texts());
    bench.armed = false;
    bench.run(2);
    assert!(bench.onboard.stats().landed);
    assert!(bench.position.horizontal_distance(&Bench::centre(TERMINAL)).0 < 2.0);

    let records = bench.records();
    assert_eq!(records.len(), bench.onboard.stats().decisions as usize);
    assert!(records.iter().enumerate().all(|(index, record)| record.sequence as usize == index));
    assert_eq!((records[0].cell, records[0].w_data, records[0].state), (START, 0.5, State::Engaged));
    assert!(records.iter().any(|record| record.w_data == 0.25 && record.logits.is_some()));
    assert_eq!(records.last().unwrap().state, State::Homing);
    for text in ["engaged at (1, 1)", "w_data 0.25", "return requested", "landing", "landed"] {
        assert!(bench.texts().iter().any(|line| line.contains(text)), "{text}: {:?}", bench.texts());
    }
    let names: Vec<String> = bench
        .all::<dialect::NAMED_VALUE_FLOAT_DATA>()
        .iter()
        .map(|data| data.name.to_str().unwrap().to_owned())
        .collect();
    for name in ["w_data", "collected", "spare_bat"] {
        assert!(names.iter().any(|sent| sent == name), "{name}");
    }
}

#[test]
fn heartbeat_and_targets_end_with_the_polls() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.sent.clear();
    for _ in 0..100 {
        bench.streams();
        bench.now = bench.now + Duration::from_millis(100);
        bench.carry_away();
    }
    assert!(bench.sent.is_empty());
    bench.tick();
    assert_eq!(bench.onboard.state(), State::Fault, "and the next poll knows that it is late");
}

#[test]
fn a_take_over_that_is_over_before_the_next_poll_still_counts() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.mode = 5;
    bench.heartbeat();
    bench.mode = 4;
    bench.heartbeat();
    bench.tick();
    assert_eq!(bench.onboard.state(), State::Passive);
    bench.sent.clear();
    bench.run(10);
    assert!(bench.all::<dialect::SET_POSITION_TARGET_LOCAL_NED_DATA>().is_empty());
    let commands = bench.all::<dialect::COMMAND_LONG_DATA>();
    assert!(
        commands.iter().all(|asked| asked.command == MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL),
        "it still listens, and asks for what it listens to"
    );
}

#[test]
fn reports_count_from_the_radio_and_from_the_tunnel() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    let report =
        |device, snr, remaining| Report { device, snr: Db(snr), remaining: Some(remaining), age_ms: 100 };
    bench.onboard.receive_radio(bench.now, &encode(&report(7, 11.0, 3000.0)));
    bench.onboard.receive_radio(bench.now, &encode(&report(300, 11.0, 3000.0)));
    let mut modem = Component::new(gleaner_link::Settings::new(Some(3), 192).unwrap(), Parameters::default());
    modem.tunnel(TUNNEL_RADIO_REPORT, &encode_body(&report(9, 6.0, 1000.0)));
    modem.tunnel(TUNNEL_RADIO_REPORT, &[0xFF; 9]);
    let mut bytes = [0; 512];
    let used = modem.transmit(&mut bytes);
    bench.onboard.receive_link(bench.now, &bytes[..used]);
    bench.run(4);
    let stats = bench.onboard.stats();
    assert_eq!(stats.collected, 0.5, "4000 of 8000 are left");
    assert_eq!((stats.tunnel_refused, stats.reports.unknown, stats.radio.reports), (1, 1, 2));
    let asked = bench.onboard.policy().asked.last().unwrap();
    assert_eq!([asked.devices[0][3], asked.devices[1][3]], [11.0, 6.0], "each in its own token");
    bench.run(15);
    let stale = bench.onboard.policy().asked.last().unwrap();
    assert_eq!([stale.devices[0][4], stale.devices[1][4]], [0.0, 0.0], "older than GLN_SNR_AGE");
    assert_eq!(stale.devices[0][2], 3000.0, "what remains is remembered");
}

#[test]
fn a_decision_is_handed_out_once_and_its_time_is_told() {
    let mut bench = Bench::new(Ok(()));
    bench.engage();
    bench.run(1);
    assert_eq!(bench.onboard.decision().map(|decision| decision.sequence), Some(0));
    assert!(bench.onboard.decision().is_none());
    bench.onboard.set_inference_time(Duration::from_micros(1234));
    bench.run(2);
    let told = bench.all::<dialect::NAMED_VALUE_FLOAT_DATA>();
    assert!(told.iter().any(|data| data.name.to_str() == Ok("infer_us") && data.value == 1234.0));
}

#[test]
fn a_pilot_that_failed_its_self_test_rejects_the_command_to_engage() {
    let mut bench = Bench::new(Err(SelfTestError::NoGolden));
    bench.run(8);
    bench.command(MavCmd::MAV_CMD_USER_2, 1.0);
    bench.run(5);
    assert_eq!(bench.onboard.state(), State::Fault);
    let acks = bench.all::<dialect::COMMAND_ACK_DATA>();
    assert_eq!(acks[0].result, MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
    assert_eq!(
        bench.all::<dialect::HEARTBEAT_DATA>().last().unwrap().system_status,
        MavState::MAV_STATE_CRITICAL
    );
}

#[test]
fn a_knob_sets_the_preference_for_everyone_to_see() {
    let mut bench = Bench::new(Ok(()));
    bench.run(8);
    let set = dialect::PARAM_SET_DATA {
        param_value: 6.0,
        target_system: bench.onboard.link().address().system,
        target_component: 191,
        param_id: "GLN_W_RC".into(),
        ..dialect::PARAM_SET_DATA::DEFAULT
    };
    bench.hear(STATION, &set);
    let mut turn = |pulse_us| {
        bench.sent.clear();
        let channels = dialect::RC_CHANNELS_DATA {
            time_boot_ms: bench.now.as_boot_ms(),
            chancount: 8,
            chan6_raw: pulse_us,
            ..dialect::RC_CHANNELS_DATA::DEFAULT
        };
        bench.hear(AUTOPILOT, &channels);
        bench.run(1);
        let echoes = bench.all::<dialect::PARAM_VALUE_DATA>();
        let echo = echoes.iter().rfind(|data| data.param_id.to_str() == Ok("GLN_W_DATA"));
        (echo.map(|data| data.param_value), bench.onboard.parameters().data_weight())
    };
    assert_eq!(turn(1750), (Some(0.75), 0.75));
    assert_eq!(turn(1756), (None, 0.75), "jitter is told to nobody");
    assert_eq!(turn(1000), (Some(0.0), 0.0));
}

#[test]
fn the_whole_pilot_fits_a_small_microcontroller() {
    let bytes = size_of::<Onboard<()>>();
    assert!(bytes <= 32 * 1024, "{bytes} bytes without the engine");
}

#[test]
fn a_grounded_pilot_takes_one_mission_and_only_before_its_first_poll() {
    let grounded =
        || Onboard::grounded(Parameters::default(), Settings::default().checked().unwrap(), hovering());
    let mut pilot = grounded();
    let mut spoilt = mission();
    spoilt.fence.remove(TERMINAL);
    assert!(matches!(pilot.load(&spoilt, Ok(())), Err(OnboardError::Mission(_))));
    assert_eq!(pilot.load(&mission(), Ok(())), Ok(()), "a refused mission leaves no trace");
    assert_eq!(pilot.load(&mission(), Ok(())), Err(OnboardError::Begun), "one is enough");
    pilot.poll(Instant::ZERO);
    assert_eq!(pilot.state(), State::Idle);
    assert_eq!(pilot.machine().mission(), &mission());

    let mut without = grounded();
    without.poll(Instant::ZERO);
    assert_eq!(without.state(), State::Fault, "speaks, never engages");
    assert_eq!(without.load(&mission(), Ok(())), Err(OnboardError::Begun));
}
