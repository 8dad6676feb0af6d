//! A test bench: one simulated autopilot, driven through its bytes.

use super::{AircraftSettings, Autopilot, AutopilotKind, EnergyModel, LinkId, Pack, Truth};
use crate::wire::{Speaker, parse};
use gleaner_link::{Address, Frame, FrameDecoder};
use gleaner_units::{BatteryUnits, Duration, GeoPoint, Instant, Ned};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

pub(super) const LINK: LinkId = LinkId::COMPANION;

pub(super) struct Bench {
    pub autopilot: Box<dyn Autopilot>,
    pub now: Instant,
    speaker: Speaker,
    /// Frames received on the links that were read.
    pub received: Vec<Frame>,
}

impl Bench {
    pub fn new(kind: AutopilotKind) -> Bench {
        let settings = AircraftSettings {
            system_id: 1,
            origin: GeoPoint { lat_deg_e7: 481_000_000, lon_deg_e7: 115_000_000 },
            stand: Ned { north_m: 12.0, east_m: -7.0, down_m: 0.5 },
            pack: Pack::new(BatteryUnits(200.0), EnergyModel::Nominal),
            wander_m: 0.0,
            seed: 1,
        };
        let speaker = Speaker::new(Address::new(1, 191));
        Bench { autopilot: kind.boot(settings), now: Instant::ZERO, speaker, received: Vec::new() }
    }

    pub fn truth(&self) -> Truth {
        self.autopilot.truth()
    }

    pub fn send<D: MessageData>(&mut self, data: &D) {
        let bytes = self.speaker.frame(data);
        self.autopilot.receive(LINK, &bytes);
    }

    /// Reads what left on a link.
    pub fn read(&mut self, link: LinkId) {
        let mut decoder = FrameDecoder::new();
        for bytes in self.autopilot.transmit(link) {
            let mut bytes = &bytes[..];
            self.received.extend(std::iter::from_fn(|| decoder.read(&mut bytes)));
        }
        assert_eq!(decoder.stats().garbage_bytes, 0);
    }

    pub fn run(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f32(seconds as f32);
        while self.now < end {
            self.now = self.now + Duration::from_millis(20);
            self.autopilot.step(self.now);
            self.read(LINK);
        }
    }

    /// Runs with a position target sent at 10 Hz.
    pub fn stream(&mut self, seconds: f64, target: [f32; 3]) {
        let end = self.now + Duration::from_secs_f32(seconds as f32);
        while self.now < end {
            self.target(target);
            self.run(0.1);
        }
    }

    /// Seconds until the condition holds, at most `limit_s`.
    pub fn run_until(&mut self, limit_s: f32, done: impl Fn(&Truth) -> bool) -> f32 {
        let start = self.now;
        while !done(&self.truth()) && (self.now - start).as_secs_f32() < limit_s {
            self.run(0.02);
        }
        (self.now - start).as_secs_f32()
    }

    /// Parameters 1, 2, 3 and 7; the acknowledged result.
    pub fn command(&mut self, command: MavCmd, [param1, param2, param3, param7]: [f32; 4]) -> Option<u8> {
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
        self.read(LINK);
        let ack = self.received.iter().rfind(|frame| frame.message_id == COMMAND_ACK_DATA::ID)?;
        let id = u16::from_le_bytes([ack.payload()[0], ack.payload()[1]]);
        assert_eq!(u32::from(id), command as u32);
        Some(ack.payload()[2])
    }

    pub fn target(&mut self, [x, y, z]: [f32; 3]) {
        self.target_in(MavFrame::MAV_FRAME_LOCAL_NED, [x, y, z]);
    }

    pub fn target_in(&mut self, coordinate_frame: MavFrame, [x, y, z]: [f32; 3]) {
        self.send(&SET_POSITION_TARGET_LOCAL_NED_DATA {
            x,
            y,
            z,
            type_mask: PositionTargetTypemask::from_bits_retain(3576),
            coordinate_frame,
            target_system: 1,
            target_component: 1,
            ..SET_POSITION_TARGET_LOCAL_NED_DATA::DEFAULT
        });
    }

    pub fn count(&self, message_id: u32) -> usize {
        self.received.iter().filter(|frame| frame.message_id == message_id).count()
    }

    pub fn all<D: MessageData>(&self) -> Vec<D> {
        self.received.iter().filter_map(parse::<D>).collect()
    }

    pub fn texts(&self) -> Vec<String> {
        self.all::<STATUSTEXT_DATA>().iter().map(|text| text.text.to_str().unwrap().to_owned()).collect()
    }
}
