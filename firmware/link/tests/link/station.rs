//! The other end of the wire: golden packets by name, and a component with its clock.

use gleaner_link::{
    Address, Component, Event, Frame, FrameDecoder, Message, Packet, Parameters, Settings, Status,
    SystemState,
};
use gleaner_units::Instant;

/// The frame of this name, made by pymavlink.
pub fn golden(name: &str) -> Vec<u8> {
    let packets = include_str!("../golden/packets.txt");
    let hex = packets.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    let hex = hex.unwrap_or_else(|| panic!("no golden packet {name}"));
    (0..hex.len() / 2).map(|at| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap()).collect()
}

/// All frames in `bytes`, which must contain nothing else.
pub fn frames(bytes: &[u8]) -> Vec<Frame> {
    let mut decoder = FrameDecoder::new();
    let mut rest = bytes;
    let frames = std::iter::from_fn(|| decoder.read(&mut rest)).collect();
    assert_eq!(decoder.stats().garbage_bytes, 0);
    frames
}

pub const VEHICLE: Address = Address::new(42, 1);
pub const STATION: Address = Address::new(255, 190);

/// A component and its clock.
pub struct Bench {
    pub component: Component,
    pub now_ms: u64,
    pub status: Status,
}

impl Bench {
    /// A component that has adopted system 42 and is connected to its ArduCopter.
    pub fn connected() -> Bench {
        let mut bench = Bench::fresh();
        for _ in 0..5 {
            bench.hear("heartbeat_copter_guided");
            bench.run(1_000);
        }
        bench.hear("heartbeat_copter_guided");
        bench.events();
        bench.sent();
        bench
    }

    /// A component before the first byte.
    pub fn fresh() -> Bench {
        Bench::with(Settings::default())
    }

    pub fn with(settings: Settings) -> Bench {
        let component = Component::new(settings, Parameters::default());
        let status = Status { state: SystemState::Active, may_engage: true, may_return: true };
        Bench { component, now_ms: 1_000, status }
    }

    pub fn now(&self) -> Instant {
        Instant::from_millis(self.now_ms)
    }

    pub fn hear(&mut self, name: &str) {
        let now = self.now();
        self.component.receive(now, &golden(name));
    }

    pub fn hear_packet(&mut self, sender: Address, packet: &Packet) {
        let now = self.now();
        self.component.receive(now, &packet.frame(sender, 0));
    }

    /// Lets time pass in steps of 50 ms, with a poll at the end of each.
    pub fn run(&mut self, millis: u64) {
        for _ in 0..millis / 50 {
            self.now_ms += 50;
            let now = self.now();
            self.component.poll(now, &self.status);
        }
    }

    pub fn events(&mut self) -> Vec<Event> {
        std::iter::from_fn(|| self.component.next_event()).collect()
    }

    pub fn sent_bytes(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut buffer = [0; 37];
        loop {
            let count = self.component.transmit(&mut buffer);
            if count == 0 {
                return bytes;
            }
            bytes.extend_from_slice(&buffer[..count]);
        }
    }

    pub fn sent(&mut self) -> Vec<Frame> {
        frames(&self.sent_bytes())
    }

    /// Sent frames with this message id.
    pub fn sent_with_id(&mut self, id: u32) -> Vec<Frame> {
        self.sent().into_iter().filter(|frame| frame.message_id == id).collect()
    }
}

pub fn message(name: &str) -> Option<Message> {
    Message::decode(&frames(&golden(name))[0]).unwrap()
}
