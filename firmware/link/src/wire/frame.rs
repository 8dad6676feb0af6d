//! One received frame.

use crate::address::Address;
use heapless::Vec;

/// Longest payload of a frame, bytes.
pub const MAX_PAYLOAD_BYTES: usize = 255;
/// Signature of a MAVLink 2 frame: link id (1), timestamp (6), truncated SHA-256 (6).
pub const SIGNATURE_BYTES: usize = 13;
pub(crate) const MAGIC_V1: u8 = 0xFE;
pub(crate) const MAGIC_V2: u8 = 0xFD;
pub(crate) const HEADER_V1: usize = 6;
pub(crate) const HEADER_V2: usize = 10;
pub(crate) const CHECKSUM: usize = 2;
/// Incompatibility flag of a signed frame (`MAVLINK_IFLAG_SIGNED`), the only one that MAVLink defines.
pub(crate) const FLAG_SIGNED: u8 = 0x01;
/// Longest frame, bytes.
pub const MAX_FRAME_BYTES: usize = HEADER_V2 + MAX_PAYLOAD_BYTES + CHECKSUM + SIGNATURE_BYTES;

/// Protocol version of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireVersion {
    /// MAVLink 1: ids up to 255, no truncation, no extensions.
    V1,
    /// MAVLink 2.
    V2,
}

/// One packet whose checksum is right for a message of the dialect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Sender.
    pub sender: Address,
    /// Packet counter of the sender.
    pub sequence: u8,
    /// Message id.
    pub message_id: u32,
    /// Protocol version.
    pub version: WireVersion,
    /// Compatibility flags as sent; a receiver may ignore them.
    pub compatibility: u8,
    /// Checksum as sent.
    pub checksum: u16,
    /// Signature, if the frame carries one. The decoder does not verify it; see [`crate::Signing`].
    pub signature: Option<[u8; SIGNATURE_BYTES]>,
    /// Whether the frame was complete before the newest bytes arrived: it waited behind a damaged frame, and its age is
    /// unknown. It is no evidence of what holds now.
    pub late: bool,
    pub(crate) payload: Vec<u8, MAX_PAYLOAD_BYTES>,
}

impl Frame {
    /// The payload as sent. MAVLink 2 leaves trailing zeros out: absent bytes are zero.
    #[must_use]
    pub fn payload(&self) -> &[u8] {
        &self.payload
    }

    /// The bytes of the MAVLink 2 frame up to the checksum, which the signature covers.
    pub(crate) fn header_v2(&self) -> [u8; HEADER_V2] {
        let [id0, id1, id2, _] = self.message_id.to_le_bytes();
        let flags = if self.signature.is_some() { FLAG_SIGNED } else { 0 };
        let Address { system, component } = self.sender;
        let length = self.payload.len() as u8;
        [MAGIC_V2, length, flags, self.compatibility, self.sequence, system, component, id0, id1, id2]
    }
}
