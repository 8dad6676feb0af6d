//! Bytes to frames, whatever lies between them.

use crate::Address;
use core::ops::Range;
use heapless::Vec;
use mavlink::Message as _;
use mavlink::dialects::ardupilotmega::MavMessage;

/// Longest payload of a frame.
pub const MAX_PAYLOAD_BYTES: usize = 255;
const MAGIC_V1: u8 = 0xFE;
const MAGIC_V2: u8 = 0xFD;
const HEADER_V1: usize = 6;
const HEADER_V2: usize = 10;
const CHECKSUM: usize = 2;
const SIGNATURE: usize = 13;
const FLAG_SIGNED: u8 = 0x01;
/// Longest MAVLink 2 frame, with signature.
pub const MAX_FRAME_BYTES: usize = HEADER_V2 + MAX_PAYLOAD_BYTES + CHECKSUM + SIGNATURE;
/// Room for one incomplete frame and as much again to read ahead.
const CAPACITY: usize = 2 * MAX_FRAME_BYTES;

/// Which protocol version a frame came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireVersion {
    /// MAVLink 1: ids up to 255, no truncation, no extensions.
    V1,
    /// MAVLink 2.
    V2,
}

/// One packet whose checksum was right for a message that the dialect knows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Who sent it.
    pub sender: Address,
    /// The sender's packet counter.
    pub sequence: u8,
    /// Message id.
    pub message_id: u32,
    /// Protocol version.
    pub version: WireVersion,
    /// Whether a signature followed. It was skipped, not verified.
    pub signed: bool,
    payload: Vec<u8, MAX_PAYLOAD_BYTES>,
}

impl Frame {
    /// The payload as sent. In MAVLink 2 trailing zeros are missing: absent bytes are zero.
    #[must_use]
    pub fn payload(&self) -> &[u8] {
        &self.payload
    }
}

/// What came in, by kind. Counters stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecodeStats {
    /// Frames handed out.
    pub frames: u32,
    /// Frames handed out that carried a signature.
    pub signed: u32,
    /// Candidates with a wrong checksum: damaged frames, and garbage that looked like a frame.
    pub bad_crc: u32,
    /// Candidates with an id outside the dialect (MAVLink 1: outside what we need). Not an error: newer senders
    /// have newer messages.
    pub unknown_message: u32,
    /// Candidates with an incompatibility flag that we do not know.
    pub incompatible: u32,
    /// Bytes that belonged to no frame handed out.
    pub garbage_bytes: u32,
}

/// Finds frames in a stream of bytes.
///
/// A candidate that turns out wrong is searched again from its second byte, so a false magic byte costs no
/// frame that follows it completely. A candidate with an unknown id is dropped as soon as its header is there:
/// its checksum cannot be verified, so its length cannot be believed either.
///
/// # Cost
/// Linear in the bytes for clean input. Garbage made of magic bytes costs one checksum per magic byte.
#[derive(Clone, Debug)]
pub struct FrameDecoder {
    buffer: [u8; CAPACITY],
    start: usize,
    end: usize,
    stats: DecodeStats,
}

/// What the bytes at the front of the buffer are.
enum Front {
    /// Nothing can be said before more bytes arrive.
    Incomplete,
    /// This many bytes are no frame.
    Garbage(usize),
    BadCrc,
    UnknownMessage,
    Incompatible,
    /// A frame: its header, its payload and its length on the wire.
    Frame(Header, Range<usize>, usize),
}

impl Default for FrameDecoder {
    fn default() -> FrameDecoder {
        FrameDecoder::new()
    }
}

impl FrameDecoder {
    /// A decoder that has seen nothing.
    #[must_use]
    pub const fn new() -> FrameDecoder {
        FrameDecoder {
            buffer: [0; CAPACITY],
            start: 0,
            end: 0,
            stats: DecodeStats {
                frames: 0,
                signed: 0,
                bad_crc: 0,
                unknown_message: 0,
                incompatible: 0,
                garbage_bytes: 0,
            },
        }
    }

    /// Takes in bytes and returns how many. Less than all when the buffer is full; after
    /// [`FrameDecoder::next_frame`] has returned `None` there is always room for some.
    #[must_use]
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        self.move_to_front();
        let room = self.buffer.get_mut(self.end..).unwrap_or(&mut []);
        let taken = room.len().min(bytes.len());
        for (slot, byte) in room.iter_mut().zip(bytes) {
            *slot = *byte;
        }
        self.end += taken;
        taken
    }

    /// The next frame, `None` when more bytes are needed.
    pub fn next_frame(&mut self) -> Option<Frame> {
        loop {
            let held = self.buffer.get(self.start..self.end)?;
            match front(held) {
                Front::Incomplete => return None,
                Front::Garbage(count) => self.drop_bytes(count),
                Front::BadCrc => {
                    self.stats.bad_crc = self.stats.bad_crc.saturating_add(1);
                    self.drop_bytes(1);
                }
                Front::UnknownMessage => {
                    self.stats.unknown_message = self.stats.unknown_message.saturating_add(1);
                    self.drop_bytes(1);
                }
                Front::Incompatible => {
                    self.stats.incompatible = self.stats.incompatible.saturating_add(1);
                    self.drop_bytes(1);
                }
                Front::Frame(header, payload, length) => {
                    let payload = Vec::from_slice(held.get(payload).unwrap_or(&[])).unwrap_or_default();
                    self.start += length;
                    self.stats.frames = self.stats.frames.saturating_add(1);
                    self.stats.signed = self.stats.signed.saturating_add(u32::from(header.signed));
                    return Some(header.frame(payload));
                }
            }
        }
    }

    /// The counters.
    #[must_use]
    pub const fn stats(&self) -> DecodeStats {
        self.stats
    }

    fn drop_bytes(&mut self, count: usize) {
        self.start += count;
        self.stats.garbage_bytes = self.stats.garbage_bytes.saturating_add(count as u32);
    }

    fn move_to_front(&mut self) {
        if self.start == 0 {
            return;
        }
        let held = self.end.saturating_sub(self.start);
        for at in 0..held {
            let byte = self.buffer.get(self.start + at).copied().unwrap_or(0);
            if let Some(slot) = self.buffer.get_mut(at) {
                *slot = byte;
            }
        }
        self.start = 0;
        self.end = held;
    }
}

/// Judges the bytes from the first one on.
fn front(held: &[u8]) -> Front {
    match held.first() {
        None => Front::Incomplete,
        Some(&MAGIC_V1) => front_v1(held),
        Some(&MAGIC_V2) => front_v2(held),
        Some(_) => {
            let is_magic = |byte: &u8| matches!(*byte, MAGIC_V1 | MAGIC_V2);
            Front::Garbage(held.iter().position(is_magic).unwrap_or(held.len()))
        }
    }
}

/// MAVLink guide, "Packet Serialization", MAVLink 1: magic, length, sequence, system, component, id.
fn front_v1(held: &[u8]) -> Front {
    let &[_, length, sequence, system, component, id, ..] = held else {
        return Front::Incomplete;
    };
    if length_v1(id) != Some(length) {
        return Front::UnknownMessage;
    }
    let header = Header {
        sender: Address::new(system, component),
        sequence,
        message_id: u32::from(id),
        version: WireVersion::V1,
        signed: false,
    };
    header.verify(held, HEADER_V1, usize::from(length))
}

/// MAVLink 2: magic, length, incompatibility flags, compatibility flags, sequence, system, component, id (3).
fn front_v2(held: &[u8]) -> Front {
    let flags = held.get(2).copied().unwrap_or(0);
    if flags & !FLAG_SIGNED != 0 {
        return Front::Incompatible;
    }
    let &[_, length, _, _, sequence, system, component, id0, id1, id2, ..] = held else {
        return Front::Incomplete;
    };
    let header = Header {
        sender: Address::new(system, component),
        sequence,
        message_id: u32::from_le_bytes([id0, id1, id2, 0]),
        version: WireVersion::V2,
        signed: flags & FLAG_SIGNED != 0,
    };
    header.verify(held, HEADER_V2, usize::from(length))
}

/// Payload length of the MAVLink 1 messages that we need. Eight bits of id and no flags make a MAVLink 1 header
/// easy to mistake noise for, so only these are believed, and only with their exact length.
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
    signed: bool,
}

impl Header {
    fn verify(self, held: &[u8], header_bytes: usize, payload_bytes: usize) -> Front {
        // 0 says "not in the dialect". COMPONENT_INFORMATION (395, deprecated) truly has 0; nobody here needs it.
        let extra = MavMessage::extra_crc(self.message_id);
        if extra == 0 {
            return Front::UnknownMessage;
        }
        let checked = header_bytes + payload_bytes;
        let length = checked + CHECKSUM + if self.signed { SIGNATURE } else { 0 };
        let (Some(body), Some(&[low, high]), true) =
            (held.get(1..checked), held.get(checked..checked + CHECKSUM), held.len() >= length)
        else {
            return Front::Incomplete;
        };
        if mavlink::calculate_crc(body, extra) != u16::from_le_bytes([low, high]) {
            return Front::BadCrc;
        }
        Front::Frame(self, header_bytes..checked, length)
    }

    fn frame(self, payload: Vec<u8, MAX_PAYLOAD_BYTES>) -> Frame {
        Frame {
            sender: self.sender,
            sequence: self.sequence,
            message_id: self.message_id,
            version: self.version,
            signed: self.signed,
            payload,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_of_mavlink_1_are_those_of_the_other_implementation() {
        let lines =
            include_str!("../tests/golden/lengths_v1.txt").lines().filter(|line| !line.starts_with('#'));
        let mut checked = 0;
        for line in lines {
            let (id, length) = line.split_once(' ').unwrap();
            if let Some(ours) = length_v1(id.parse().unwrap()) {
                assert_eq!(ours, length.parse::<u8>().unwrap(), "message {id}");
                checked += 1;
            }
        }
        assert_eq!(checked, (0..=255).filter(|&id| length_v1(id).is_some()).count());
    }
}
