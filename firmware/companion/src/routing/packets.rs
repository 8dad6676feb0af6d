//! Bytes of one port to whole MAVLink packets, unchanged, so that they can be forwarded.
//!
//! The pilot's own decoder hands out the messages that the pilot needs. A router also forwards messages that it does
//! not know, with their signature.

use gleaner_link::checksum;
use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{MavlinkVersion, Message as _};

const MAGIC_V1: u8 = 0xFE;
const MAGIC_V2: u8 = 0xFD;
const HEADER_V1: usize = 6;
const HEADER_V2: usize = 10;
const CHECKSUM: usize = 2;
const SIGNATURE: usize = 13;
const FLAG_SIGNED: u8 = 0x01;

/// System and component id.
pub type Address = (u8, u8);

/// One packet as it came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// The whole packet.
    pub bytes: Vec<u8>,
    /// Its sender.
    pub sender: Address,
    /// Its message id.
    pub message_id: u32,
    /// The addressee named in the message; component 0 is every component. `None`: the message names no system, or
    /// system 0.
    pub target: Option<Address>,
    /// Whether the message is known and its checksum right. The checksum of an unknown message cannot be verified.
    pub verified: bool,
}

impl Packet {
    /// The payload as it came: MAVLink 2 leaves out trailing zeros.
    pub fn payload(&self) -> &[u8] {
        let length = self.bytes.get(1).copied().map_or(0, usize::from);
        let header = if self.bytes.first() == Some(&MAGIC_V2) { HEADER_V2 } else { HEADER_V1 };
        self.bytes.get(header..header + length).unwrap_or(&[])
    }
}

/// Counters of one port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PacketStats {
    /// Packets found.
    pub packets: u64,
    /// Candidates whose checksum was wrong.
    pub damaged: u64,
    /// Bytes that belong to no packet.
    pub garbage_bytes: u64,
}

/// Finds packets in the bytes of one port.
#[derive(Debug, Default)]
pub struct Packets {
    held: Vec<u8>,
    stats: PacketStats,
}

/// What the first bytes are.
enum Front {
    Incomplete,
    Garbage,
    Damaged,
    Packet(Packet),
}

impl Packets {
    /// Takes bytes and calls `found` for each whole packet.
    pub fn push(&mut self, bytes: &[u8], mut found: impl FnMut(Packet)) {
        self.held.extend_from_slice(bytes);
        let mut start = 0;
        while let Some(rest) = self.held.get(start..).filter(|rest| !rest.is_empty()) {
            match front(rest) {
                Front::Incomplete => break,
                Front::Garbage => {
                    let next = rest.iter().skip(1).position(|&byte| is_magic(byte));
                    let garbage = next.map_or(rest.len(), |at| at + 1);
                    self.stats.garbage_bytes += garbage as u64;
                    start += garbage;
                }
                // A false magic byte costs no packet that follows it: the search continues with the second byte.
                Front::Damaged => {
                    self.stats.damaged += 1;
                    self.stats.garbage_bytes += 1;
                    start += 1;
                }
                Front::Packet(packet) => {
                    self.stats.packets += 1;
                    start += packet.bytes.len();
                    found(packet);
                }
            }
        }
        self.held.drain(..start);
    }

    /// Drops an incomplete packet. A datagram does not continue in the next one.
    pub fn end_datagram(&mut self) {
        self.stats.garbage_bytes += self.held.len() as u64;
        self.held.clear();
    }

    /// The counters.
    pub fn stats(&self) -> PacketStats {
        self.stats
    }
}

fn is_magic(byte: u8) -> bool {
    matches!(byte, MAGIC_V1 | MAGIC_V2)
}

/// MAVLink guide, "Packet Serialization".
fn front(held: &[u8]) -> Front {
    let (header, length, signature, sender, message_id, version) = match *held {
        [MAGIC_V1, length, _, system, component, id, ..] => {
            (HEADER_V1, length, 0, (system, component), u32::from(id), MavlinkVersion::V1)
        }
        [MAGIC_V2, length, flags, _, _, system, component, id0, id1, id2, ..] => {
            if flags & !FLAG_SIGNED != 0 {
                return Front::Garbage;
            }
            let signature = if flags & FLAG_SIGNED != 0 { SIGNATURE } else { 0 };
            let id = u32::from_le_bytes([id0, id1, id2, 0]);
            (HEADER_V2, length, signature, (system, component), id, MavlinkVersion::V2)
        }
        [first, ..] if is_magic(first) => return Front::Incomplete,
        _ => return Front::Garbage,
    };
    let checked = header + usize::from(length);
    let whole = checked + CHECKSUM + signature;
    let Some(bytes) = held.get(..whole) else { return Front::Incomplete };
    let extra = MavMessage::extra_crc(message_id);
    let verified = extra != 0;
    if verified {
        let expected = checksum(&bytes[1..checked], extra).to_le_bytes();
        if bytes[checked..checked + CHECKSUM] != expected {
            return Front::Damaged;
        }
    } else if version == MavlinkVersion::V1 || held.get(whole).is_some_and(|&next| !is_magic(next)) {
        // The length of an unknown message is used only where another packet or nothing follows it.
        return Front::Garbage;
    }
    let target = if verified { target(version, message_id, &bytes[header..checked]) } else { None };
    Front::Packet(Packet { bytes: bytes.to_vec(), sender, message_id, target, verified })
}

fn target(version: MavlinkVersion, message_id: u32, payload: &[u8]) -> Option<Address> {
    let message = MavMessage::parse(version, message_id, payload).ok()?;
    let system = message.target_system_id().filter(|&system| system != 0)?;
    Some((system, message.target_component_id().unwrap_or(0)))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use gleaner_link::Packet as Outgoing;
    use mavlink::MessageData;
    use mavlink::dialects::ardupilotmega::*;

    pub(in crate::routing) fn frame(message: &impl MessageData, sender: Address, sequence: u8) -> Vec<u8> {
        let sender = gleaner_link::Address::new(sender.0, sender.1);
        Outgoing::new(message).unwrap().frame(sender, sequence).to_vec()
    }

    pub(in crate::routing) fn heartbeat(sender: Address, sequence: u8) -> Vec<u8> {
        frame(&HEARTBEAT_DATA { mavlink_version: 3, ..HEARTBEAT_DATA::DEFAULT }, sender, sequence)
    }

    /// A MAVLink 2 packet of a message that no dialect knows.
    pub(in crate::routing) fn unknown(sender: Address) -> Vec<u8> {
        vec![MAGIC_V2, 3, 0, 0, 7, sender.0, sender.1, 0x11, 0x22, 0x33, 1, 2, 3, 0xAA, 0xBB]
    }

    fn found(packets: &mut Packets, bytes: &[u8]) -> Vec<Packet> {
        let mut all = Vec::new();
        packets.push(bytes, |packet| all.push(packet));
        all
    }

    #[test]
    fn packets_are_found_in_pieces_and_between_garbage() {
        let mut packets = Packets::default();
        let first = heartbeat((1, 1), 0);
        let command =
            COMMAND_LONG_DATA { target_system: 1, target_component: 191, ..COMMAND_LONG_DATA::DEFAULT };
        let second = frame(&command, (255, 190), 1);
        let stream = [&[0x00, MAGIC_V2, 0xFF][..], &first, &[0xAB], &second].concat();
        let mut all = Vec::new();
        for byte in stream {
            all.extend(found(&mut packets, &[byte]));
        }
        // The false magic byte waits for its packet; the real ones are found when it turns out damaged.
        all.extend(found(&mut packets, &[0; 300]));
        assert_eq!(all.len(), 2, "{all:?}");
        assert_eq!((&all[0].bytes, all[0].sender, all[0].target), (&first, (1, 1), None));
        assert_eq!((&all[1].bytes, all[1].sender, all[1].target), (&second, (255, 190), Some((1, 191))));
    }

    #[test]
    fn a_damaged_packet_is_counted_and_costs_only_itself() {
        let mut packets = Packets::default();
        let mut damaged = heartbeat((1, 1), 0);
        damaged[12] ^= 1;
        let all = found(&mut packets, &[damaged, heartbeat((1, 1), 1)].concat());
        assert_eq!(all.len(), 1);
        assert_eq!(packets.stats().damaged, 1);
    }

    #[test]
    fn an_unknown_message_hides_no_packet_in_its_payload() {
        let mut packets = Packets::default();
        let inner = heartbeat((1, 1), 0);
        let mut outer = unknown((9, 9));
        outer[1] = inner.len() as u8;
        outer.splice(10..13, inner);
        let all = found(&mut packets, &[outer, heartbeat((1, 1), 1)].concat());
        assert_eq!(all.iter().map(|packet| packet.verified).collect::<Vec<_>>(), [false, true]);
    }

    #[test]
    fn a_datagram_does_not_continue_in_the_next() {
        let mut packets = Packets::default();
        let whole = heartbeat((1, 1), 0);
        assert!(found(&mut packets, &whole[..9]).is_empty());
        packets.end_datagram();
        assert_eq!(found(&mut packets, &whole).len(), 1);
    }
}
