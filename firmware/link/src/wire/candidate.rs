//! The bytes at one place of a stream: a frame, the start of one, or something else.

use super::checksum::checksum;
use super::frame::{
    CHECKSUM, FLAG_SIGNED, Frame, HEADER_V1, HEADER_V2, MAGIC_V1, MAGIC_V2, SIGNATURE_BYTES, WireVersion,
};
use crate::address::Address;
use heapless::Vec;
use mavlink::Message as _;
use mavlink::dialects::ardupilotmega::MavMessage;

/// Why a candidate with a plausible header is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejected {
    /// Wrong checksum.
    Checksum,
    /// MAVLink 2 id outside the dialect: the checksum cannot be verified.
    Unknown,
    /// MAVLink 1 id outside the table below, or the wrong length for it.
    UnknownV1,
    /// An incompatibility flag other than "signed".
    Incompatible,
}

/// Verdict on the bytes from the first one on.
pub enum Candidate {
    /// More bytes are needed.
    Incomplete,
    /// This many bytes cannot begin a frame.
    Garbage(usize),
    /// A header that claims `length` bytes, but no frame.
    Rejected {
        /// The reason.
        reason: Rejected,
        /// Bytes that the header claims, signature included.
        length: usize,
    },
    /// A whole packet whose checksum is right.
    Packet(Packet),
}

/// Whether `byte` begins frames.
pub fn is_magic(byte: u8) -> bool {
    matches!(byte, MAGIC_V1 | MAGIC_V2)
}

/// Judges the bytes from the first one on.
pub fn judge(held: &[u8]) -> Candidate {
    match held.first() {
        None => Candidate::Incomplete,
        Some(&MAGIC_V1) => judge_v1(held),
        Some(&MAGIC_V2) => judge_v2(held),
        Some(_) => Candidate::Garbage(held.iter().position(|&byte| is_magic(byte)).unwrap_or(held.len())),
    }
}

/// MAVLink guide, "Packet Serialization", MAVLink 1: magic, length, sequence, system, component, id.
fn judge_v1(held: &[u8]) -> Candidate {
    let &[_, length, sequence, system, component, id, ..] = held else {
        return Candidate::Incomplete;
    };
    if length_v1(id) != Some(length) {
        let length = HEADER_V1 + usize::from(length) + CHECKSUM;
        return Candidate::Rejected { reason: Rejected::UnknownV1, length };
    }
    let header = Header {
        sender: Address::new(system, component),
        sequence,
        message_id: u32::from(id),
        version: WireVersion::V1,
        compatibility: 0,
        signed: false,
    };
    header.verify(held, usize::from(length))
}

/// MAVLink 2: magic, length, incompatibility flags, compatibility flags, sequence, system, component, id (3).
fn judge_v2(held: &[u8]) -> Candidate {
    let &[_, length, flags, compatibility, sequence, system, component, id0, id1, id2, ..] = held else {
        return Candidate::Incomplete;
    };
    let signed = flags & FLAG_SIGNED != 0;
    let message_id = u32::from_le_bytes([id0, id1, id2, 0]);
    let claimed = HEADER_V2 + usize::from(length) + CHECKSUM + if signed { SIGNATURE_BYTES } else { 0 };
    if flags & !FLAG_SIGNED != 0 {
        return Candidate::Rejected { reason: Rejected::Incompatible, length: claimed };
    }
    // 0 means "not in the dialect". COMPONENT_INFORMATION (395, deprecated) really has 0; it is not needed.
    if MavMessage::extra_crc(message_id) == 0 {
        return Candidate::Rejected { reason: Rejected::Unknown, length: claimed };
    }
    let sender = Address::new(system, component);
    let header = Header { sender, sequence, message_id, version: WireVersion::V2, compatibility, signed };
    header.verify(held, usize::from(length))
}

/// Payload length of the MAVLink 1 messages that are needed. Noise often resembles a MAVLink 1 header, which has an id of
/// eight bits and no flags. Therefore only these messages are accepted, and only with their exact length.
const fn length_v1(message_id: u8) -> Option<u8> {
    Some(match message_id {
        0 => 9,
        1 => 31,
        20 => 20,
        21 => 2,
        23 => 23,
        32 | 33 => 28,
        49 => 12,
        65 | 230 => 42,
        75 => 35,
        76 => 33,
        77 => 3,
        85 => 51,
        109 => 9,
        111 => 16,
        147 => 36,
        193 => 22,
        242 => 52,
        245 => 2,
        253 => 51,
        _ => return None,
    })
}

struct Header {
    sender: Address,
    sequence: u8,
    message_id: u32,
    version: WireVersion,
    compatibility: u8,
    signed: bool,
}

impl Header {
    const fn bytes(&self) -> usize {
        match self.version {
            WireVersion::V1 => HEADER_V1,
            WireVersion::V2 => HEADER_V2,
        }
    }

    fn verify(self, held: &[u8], payload_bytes: usize) -> Candidate {
        let checked = self.bytes() + payload_bytes;
        let unsigned = checked + CHECKSUM;
        let length = unsigned + if self.signed { SIGNATURE_BYTES } else { 0 };
        let (Some(body), Some(&[low, high]), true) =
            (held.get(1..checked), held.get(checked..unsigned), held.len() >= length)
        else {
            return Candidate::Incomplete;
        };
        let sent = u16::from_le_bytes([low, high]);
        if checksum(body, MavMessage::extra_crc(self.message_id)) != sent {
            return Candidate::Rejected { reason: Rejected::Checksum, length };
        }
        Candidate::Packet(Packet { header: self, checksum: sent, checked, length })
    }
}

/// A packet in the bytes that were judged.
pub struct Packet {
    header: Header,
    checksum: u16,
    /// Bytes of header and payload.
    checked: usize,
    /// Bytes on the wire.
    pub length: usize,
}

impl Packet {
    /// The frame, from the bytes that were judged.
    pub fn frame(self, held: &[u8], late: bool) -> Frame {
        let Packet { header, checksum, checked, length } = self;
        let payload = held.get(header.bytes()..checked).unwrap_or(&[]);
        let signature = held.get(checked + CHECKSUM..length).and_then(|bytes| bytes.first_chunk().copied());
        Frame {
            sender: header.sender,
            sequence: header.sequence,
            message_id: header.message_id,
            version: header.version,
            compatibility: header.compatibility,
            checksum,
            signature,
            late,
            payload: Vec::from_slice(payload).unwrap_or_default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mavlink_1_lengths_are_pymavlinks() {
        let lines = include_str!("../../tests/golden/lengths_v1.txt").lines();
        let mut checked = 0;
        for line in lines.filter(|line| !line.starts_with('#')) {
            let (id, length) = line.split_once(' ').unwrap();
            if let Some(ours) = length_v1(id.parse().unwrap()) {
                assert_eq!(ours, length.parse::<u8>().unwrap(), "message {id}");
                checked += 1;
            }
        }
        assert_eq!(checked, (0..=255).filter(|&id| length_v1(id).is_some()).count());
    }
}
