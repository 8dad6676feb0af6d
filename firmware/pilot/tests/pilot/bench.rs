//! An ArduCopter in bytes around the whole pilot.

// Whether a message has fields beyond those named here depends on a feature of the MAVLink crate (extensions),
// which another member of the workspace may switch on.
#![allow(clippy::needless_update)]

use crate::rig::{CORNER, HOME_DOWN_M, START, Scripted, mission};
use gleaner_link::{FrameDecoder, TUNNEL_DECISION};
use gleaner_pilot::{DecisionRecord, Onboard, Parameters, Settings, State};
use gleaner_policy::SelfTestError;
use gleaner_units::{Action, Cell, Duration, Instant, Metres, Ned};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::{MavAutopilot, MavCmd, MavModeFlag, MavResult, MavState, MavType};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion};

pub const AUTOPILOT: (u8, u8) = (3, 1);
pub const STATION: (u8, u8) = (255, 190);
const ORIGIN_AMSL_MM: i32 = 584_000;

/// A policy that only hovers.
pub fn hovering() -> Scripted {
    Scripted { actions: Default::default(), then: Action::Hover, fails: false, logit: 1.0, asked: Vec::new() }
}

/// An ArduCopter that hovers in GUIDED at the start, and everything that came from the pilot.
pub struct Bench {
    pub onboard: Onboard<Scripted>,
    pub now: Instant,
    pub mode: u32,
    pub armed: bool,
    pub position: Ned,
    pub target: Option<Ned>,
    pub sent: Vec<gleaner_link::Frame>,
    pub decoder: FrameDecoder,
}

impl Bench {
    pub fn new(self_test: Result<(), SelfTestError>) -> Bench {
        let mut parameters = Parameters::default();
        parameters.set("GLN_ENABLE", 1.0).unwrap();
        let mut onboard =
            Onboard::new(mission(), parameters, Settings::default(), hovering(), self_test).unwrap();
        // An empty frame: the radio is there, and hears no device yet.
        onboard.receive_radio(Instant::ZERO, &[0]);
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

    pub fn origin() -> gleaner_units::GeoPoint {
        CORNER.offset_by(Metres(-100.0), Metres(50.0))
    }

    pub fn centre(cell: Cell) -> Ned {
        gleaner_units::GridFrame::new(mission().grid(), mission().pose, Bench::origin())
            .centre(cell, HOME_DOWN_M - 60.0)
    }

    pub fn hear<D: MessageData>(&mut self, (system_id, component_id): (u8, u8), data: &D) {
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.serialize_message_data(
            MavHeader { system_id: system_id.into(), component_id, sequence: 0 },
            data,
        );
        self.onboard.receive_link(self.now, raw.raw_bytes());
    }

    pub fn command(&mut self, command: MavCmd, param1: f32) {
        let data = dialect::COMMAND_LONG_DATA {
            command,
            param1,
            target_system: self.onboard.link().address().system,
            target_component: 191,
            ..dialect::COMMAND_LONG_DATA::DEFAULT
        };
        self.hear(STATION, &data);
    }

    pub fn heartbeat(&mut self) {
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

    pub fn streams(&mut self) {
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
    pub fn tick(&mut self) {
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

    pub fn run(&mut self, secs: u64) {
        for _ in 0..secs * 10 {
            self.tick();
        }
    }

    pub fn carry_away(&mut self) {
        let mut buffer = [0; 512];
        loop {
            let used = self.onboard.transmit(&mut buffer);
            if used == 0 {
                return;
            }
            let mut bytes = &buffer[..used];
            while let Some(frame) = self.decoder.read(&mut bytes) {
                self.obey(&frame);
                self.sent.push(frame);
            }
        }
    }

    pub fn obey(&mut self, frame: &gleaner_link::Frame) {
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

    pub fn all<D: MessageData>(&self) -> Vec<D> {
        self.sent.iter().filter(|frame| frame.message_id == D::ID).map(parse).collect()
    }

    pub fn texts(&self) -> Vec<String> {
        let text = |data: dialect::STATUSTEXT_DATA| data.text.to_str().unwrap_or_default().to_owned();
        self.all().into_iter().map(text).collect()
    }

    pub fn records(&self) -> Vec<DecisionRecord> {
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

    pub fn engage(&mut self) {
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

pub fn parse<D: MessageData>(frame: &gleaner_link::Frame) -> D {
    D::deser(MavlinkVersion::V2, frame.payload()).unwrap()
}
