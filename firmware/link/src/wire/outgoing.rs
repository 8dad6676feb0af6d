//! The queue to the wire of one link.

use super::packet::{FrameBytes, LONGEST_SENT, Packet};
use crate::address::Address;
use crate::autopilot_command::AutopilotCommand;
use crate::fields::Fields;
use heapless::{Deque, Vec};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::COMMAND_LONG_DATA;

/// Order of sending, and what happens when there is no room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Priority {
    /// One place: a newer one replaces it. First on the wire.
    Heartbeat,
    /// One place: a newer one replaces it, since an old setpoint is worse than none.
    Setpoint,
    /// Acknowledgements, requests, parameter values: in order; refused when there is no room.
    Urgent,
    /// Telemetry and texts: the oldest is dropped when there is no room.
    Bulk,
}

/// Counters of sent and dropped packets. They stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OutgoingStats {
    /// Frames handed to the wire; of the last one perhaps a part.
    pub frames: u32,
    /// Telemetry dropped because the queue was full.
    pub bulk_dropped: u32,
    /// Urgent packets refused because the queue was full.
    pub urgent_refused: u32,
    /// Setpoints replaced by a newer one before they left.
    pub setpoints_replaced: u32,
}

/// Heartbeats whose sequence numbers are remembered.
const REMEMBERED: usize = 8;

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
    heartbeats: Deque<u8, REMEMBERED>,
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
            heartbeats: Deque::new(),
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

    /// Number of urgent packets that still fit.
    #[must_use]
    pub fn urgent_room(&self) -> usize {
        Outgoing::URGENT - self.urgent.len()
    }

    /// Whether a bulk packet fits without displacing an older one.
    #[must_use]
    pub fn has_bulk_room(&self) -> bool {
        !self.bulk.is_full()
    }

    /// Withdraws the setpoint and the commands that move the aircraft, as far as they have not left.
    pub fn revoke(&mut self) {
        self.setpoint = None;
        // Not `Deque::retain`, which leaves a panic path in the image: each packet is taken out once and the others put back.
        for _ in 0..self.urgent.len() {
            if let Some(packet) = self.urgent.pop_front().filter(|packet| !moves_the_aircraft(packet)) {
                let _ = self.urgent.push_back(packet);
            }
        }
    }

    /// Whether one of the last heartbeats that left had this sequence number.
    #[must_use]
    pub fn sent_heartbeat(&self, sequence: u8) -> bool {
        self.heartbeats.iter().any(|&sent| sent == sequence)
    }

    /// Fills `out` with bytes for the wire and returns how many; 0 when there is nothing to send. An `out` with room
    /// for the longest frame ([`FrameBytes`]) gets whole frames, as a datagram needs them; a shorter one gets them
    /// in pieces.
    pub fn transmit(&mut self, sender: Address, out: &mut [u8]) -> usize {
        let room = out.len();
        let mut written = 0;
        for slot in out {
            let between_frames = self.left >= self.leaving.len();
            if between_frames && written > 0 && room - written < LONGEST_SENT {
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
            let is_heartbeat = self.heartbeat.is_some();
            let packet = self.next_packet()?;
            if is_heartbeat {
                if self.heartbeats.is_full() {
                    let _ = self.heartbeats.pop_front();
                }
                let _ = self.heartbeats.push_back(self.sequence);
            }
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
    packet.message_id() == COMMAND_LONG_DATA::ID && {
        let command = Fields(packet.payload()).u16(28);
        AutopilotCommand::KINDS.iter().any(|&kind| kind as u32 == u32::from(command))
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::{CHECKSUM, HEADER_V2 as HEADER, MAGIC_V2 as MAGIC};
    use super::super::packet::LONGEST_PAYLOAD;
    use super::*;

    #[test]
    fn long_buffers_get_whole_frames() {
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
