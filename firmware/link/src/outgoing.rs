//! Packets waiting for the wire, and their framing.

use crate::{Address, AutopilotCommand};
use heapless::{Deque, Vec};
use mavlink::dialects::ardupilotmega::COMMAND_LONG_DATA;
use mavlink::{MavlinkVersion, MessageData};

/// Longest payload that this component sends: `COMPONENT_INFORMATION_BASIC`.
const LONGEST_PAYLOAD: usize = 160;
const HEADER: usize = 10;
const CHECKSUM: usize = 2;
const MAGIC: u8 = 0xFD;

/// One frame, ready for the wire.
pub type FrameBytes = Vec<u8, { HEADER + LONGEST_PAYLOAD + CHECKSUM }>;

/// What is sent first and what may be lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Priority {
    /// One place, the newest wins. First on the wire.
    Heartbeat,
    /// One place, the newest wins: an old setpoint is worse than none.
    Setpoint,
    /// Acknowledgements, requests, parameter values: in order; refused when there is no room.
    Urgent,
    /// Telemetry and texts: the oldest is dropped when there is no room.
    Bulk,
}

/// A message not yet framed: number and sender are added when it leaves, so a dropped one leaves no gap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    message_id: u32,
    extra_crc: u8,
    payload: Vec<u8, LONGEST_PAYLOAD>,
}

impl Packet {
    /// The packet of a dialect message; `None` if it is longer than any message of ours.
    #[must_use]
    pub fn new<D: MessageData>(data: &D) -> Option<Packet> {
        let mut bytes = [0; crate::MAX_PAYLOAD_BYTES];
        let length = data.ser(MavlinkVersion::V2, &mut bytes);
        Packet::from_payload(D::ID, D::EXTRA_CRC, bytes.get(..length)?)
    }

    /// The packet of a payload laid out by hand; `None` if it is too long.
    #[must_use]
    pub fn from_payload(message_id: u32, extra_crc: u8, payload: &[u8]) -> Option<Packet> {
        Some(Packet { message_id, extra_crc, payload: Vec::from_slice(payload).ok()? })
    }

    /// The MAVLink 2 frame: trailing zeros cut off except for the first byte, no signature.
    #[must_use]
    pub fn frame(&self, sender: Address, sequence: u8) -> FrameBytes {
        let used = self.payload.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1);
        let [id0, id1, id2, _] = self.message_id.to_le_bytes();
        let header = [MAGIC, used as u8, 0, 0, sequence, sender.system, sender.component, id0, id1, id2];
        let mut frame = FrameBytes::new();
        let body = self.payload.iter().copied().chain([0]).take(used);
        // `FrameBytes` is as long as the longest frame, so nothing is cut off here.
        for byte in header.into_iter().chain(body) {
            let _ = frame.push(byte);
        }
        let checksum = mavlink::calculate_crc(frame.get(1..).unwrap_or(&[]), self.extra_crc);
        for byte in checksum.to_le_bytes() {
            let _ = frame.push(byte);
        }
        frame
    }
}

/// What went out and what did not. Counters stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OutgoingStats {
    /// Frames handed to the wire, the last one perhaps in part.
    pub frames: u32,
    /// Telemetry dropped for want of room.
    pub bulk_dropped: u32,
    /// Urgent packets refused for want of room.
    pub urgent_refused: u32,
    /// Setpoints replaced by a newer one before they left.
    pub setpoints_replaced: u32,
}

/// The queue to the wire of one link.
#[derive(Debug, Default)]
pub struct Outgoing {
    heartbeat: Option<Packet>,
    setpoint: Option<Packet>,
    urgent: Deque<Packet, { Outgoing::URGENT }>,
    bulk: Deque<Packet, { Outgoing::BULK }>,
    leaving: FrameBytes,
    left: usize,
    sequence: u8,
    stats: OutgoingStats,
}

impl Outgoing {
    const URGENT: usize = 16;
    const BULK: usize = 16;

    /// An empty queue.
    #[must_use]
    pub const fn new() -> Outgoing {
        Outgoing {
            heartbeat: None,
            setpoint: None,
            urgent: Deque::new(),
            bulk: Deque::new(),
            leaving: Vec::new(),
            left: 0,
            sequence: 0,
            stats: OutgoingStats { frames: 0, bulk_dropped: 0, urgent_refused: 0, setpoints_replaced: 0 },
        }
    }

    /// Queues a packet. `false` when an urgent one found no room.
    pub fn push(&mut self, priority: Priority, packet: Packet) -> bool {
        match priority {
            Priority::Heartbeat => self.heartbeat = Some(packet),
            Priority::Setpoint => {
                if self.setpoint.replace(packet).is_some() {
                    self.stats.setpoints_replaced = self.stats.setpoints_replaced.saturating_add(1);
                }
            }
            Priority::Urgent => {
                if self.urgent.push_back(packet).is_err() {
                    self.stats.urgent_refused = self.stats.urgent_refused.saturating_add(1);
                    return false;
                }
            }
            Priority::Bulk => {
                if self.bulk.is_full() {
                    let _ = self.bulk.pop_front();
                    self.stats.bulk_dropped = self.stats.bulk_dropped.saturating_add(1);
                }
                let _ = self.bulk.push_back(packet);
            }
        }
        true
    }

    /// How many more urgent packets fit.
    #[must_use]
    pub fn urgent_room(&self) -> usize {
        Outgoing::URGENT - self.urgent.len()
    }

    /// Whether a bulk packet fits without costing an older one.
    #[must_use]
    pub fn has_bulk_room(&self) -> bool {
        !self.bulk.is_full()
    }

    /// Withdraws the setpoint and the commands that move the aircraft, as far as they have not left.
    pub fn revoke(&mut self) {
        self.setpoint = None;
        // Once around, without them: `Deque::retain` may panic as far as a linker can tell.
        for _ in 0..self.urgent.len() {
            if let Some(packet) = self.urgent.pop_front().filter(|packet| !moves_the_aircraft(packet)) {
                let _ = self.urgent.push_back(packet);
            }
        }
    }

    /// Fills `out` with bytes for the wire and returns how many; 0 when there is nothing to send. Holds whole
    /// frames when `out` takes the longest one ([`FrameBytes`]): what a datagram wants. A shorter `out` gets
    /// them in pieces.
    pub fn transmit(&mut self, sender: Address, out: &mut [u8]) -> usize {
        let room = out.len();
        let mut written = 0;
        for slot in out {
            let between_frames = self.left >= self.leaving.len();
            if between_frames && written > 0 && room - written < HEADER + LONGEST_PAYLOAD + CHECKSUM {
                break;
            }
            let Some(byte) = self.next_byte(sender) else { break };
            *slot = byte;
            written += 1;
        }
        written
    }

    /// The counters.
    #[must_use]
    pub const fn stats(&self) -> OutgoingStats {
        self.stats
    }

    fn next_byte(&mut self, sender: Address) -> Option<u8> {
        if self.left >= self.leaving.len() {
            let packet = self.next_packet()?;
            self.leaving = packet.frame(sender, self.sequence);
            self.left = 0;
            self.sequence = self.sequence.wrapping_add(1);
            self.stats.frames = self.stats.frames.saturating_add(1);
        }
        let byte = self.leaving.get(self.left).copied();
        self.left += 1;
        byte
    }

    fn next_packet(&mut self) -> Option<Packet> {
        self.heartbeat
            .take()
            .or_else(|| self.setpoint.take())
            .or_else(|| self.urgent.pop_front())
            .or_else(|| self.bulk.pop_front())
    }
}

/// Whether a packet is a command of [`crate::AutopilotCommand`].
fn moves_the_aircraft(packet: &Packet) -> bool {
    packet.message_id == COMMAND_LONG_DATA::ID && {
        let command = crate::fields::Fields(&packet.payload).u16(28);
        AutopilotCommand::KINDS.iter().any(|&kind| kind as u32 == u32::from(command))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_for_the_longest_frame_never_gets_half_of_one() {
        let own = Address::new(1, 191);
        let payload = [1; LONGEST_PAYLOAD];
        let queue = || {
            let mut outgoing = Outgoing::new();
            for length in [160, 1, 80, 160, 30, 9] {
                let packet = Packet::from_payload(0, 50, &payload[..length]).unwrap();
                assert!(outgoing.push(Priority::Urgent, packet));
            }
            outgoing
        };
        let total = 160 + 1 + 80 + 160 + 30 + 9 + 6 * (HEADER + CHECKSUM);
        for room in [1, 16, 171, 172, 280, 1024] {
            let (mut outgoing, mut out, mut sum) = (queue(), std::vec![0; room], 0);
            loop {
                let written = outgoing.transmit(own, &mut out);
                if written == 0 {
                    break;
                }
                sum += written;
                let mut rest = &out[..written];
                while room >= 172 && !rest.is_empty() {
                    assert_eq!(rest[0], MAGIC);
                    rest = &rest[HEADER + usize::from(rest[1]) + CHECKSUM..];
                }
            }
            assert_eq!(sum, total, "room {room}");
        }
    }
}
