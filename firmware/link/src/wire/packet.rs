//! Messages to send, and their framing.

use super::checksum::checksum;
use super::frame::{CHECKSUM, HEADER_V2, MAGIC_V2, MAX_PAYLOAD_BYTES};
use crate::address::Address;
use heapless::Vec;
use mavlink::{MavlinkVersion, MessageData};

/// Longest payload that this component sends: `COMPONENT_INFORMATION_BASIC`.
pub(crate) const LONGEST_PAYLOAD: usize = 160;
/// Longest frame that this component sends, without a signature.
pub(crate) const LONGEST_SENT: usize = HEADER_V2 + LONGEST_PAYLOAD + CHECKSUM;

/// One frame, ready for the wire.
pub type FrameBytes = Vec<u8, LONGEST_SENT>;

/// A message before framing. Sequence number and sender are added when it leaves, so a dropped packet leaves no
/// gap in the sequence.
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
        let mut bytes = [0; MAX_PAYLOAD_BYTES];
        let length = data.ser(MavlinkVersion::V2, &mut bytes);
        Packet::from_payload(D::ID, D::EXTRA_CRC, bytes.get(..length)?)
    }

    /// The packet of a payload in wire layout; `None` if it is too long.
    #[must_use]
    pub fn from_payload(message_id: u32, extra_crc: u8, payload: &[u8]) -> Option<Packet> {
        Some(Packet { message_id, extra_crc, payload: Vec::from_slice(payload).ok()? })
    }

    pub(crate) const fn message_id(&self) -> u32 {
        self.message_id
    }

    pub(crate) fn payload(&self) -> &[u8] {
        &self.payload
    }

    /// The MAVLink 2 frame: trailing zeros cut off except for the first byte, no signature.
    #[must_use]
    pub fn frame(&self, sender: Address, sequence: u8) -> FrameBytes {
        let used = self.payload.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1);
        let [id0, id1, id2, _] = self.message_id.to_le_bytes();
        let header = [MAGIC_V2, used as u8, 0, 0, sequence, sender.system, sender.component, id0, id1, id2];
        let mut frame = FrameBytes::new();
        // `FrameBytes` has room for the longest frame, so nothing is cut off here.
        let _ = frame.extend_from_slice(&header);
        // An empty payload is sent as one zero.
        let _ = frame.extend_from_slice(self.payload.get(..used).unwrap_or(&[0]));
        let sum = checksum(frame.get(1..).unwrap_or(&[]), self.extra_crc);
        let _ = frame.extend_from_slice(&sum.to_le_bytes());
        frame
    }
}
