//! MAVLink frames of the simulated participants.
//!
//! Reading goes through [`gleaner_link::FrameDecoder`]. Writing goes through the types that the MAVLink definitions
//! generate, not through the firmware's own writer, so the firmware is never tested against itself.

use gleaner_link::{Address, Frame, WireVersion};
use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{MavHeader, MavlinkVersion, Message, MessageData};

/// A sender of messages: an address and a packet counter.
#[derive(Clone, Debug)]
pub(crate) struct Speaker {
    address: Address,
    sequence: u8,
}

impl Speaker {
    pub const fn new(address: Address) -> Speaker {
        Speaker { address, sequence: 0 }
    }

    /// The next frame of this speaker.
    pub fn frame<D: MessageData>(&mut self, data: &D) -> Vec<u8> {
        let header = MavHeader {
            system_id: self.address.system.into(),
            component_id: self.address.component,
            sequence: self.sequence,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut raw = mavlink::MAVLinkV2MessageRaw::new();
        raw.serialize_message_data(header, data);
        raw.raw_bytes().to_vec()
    }

    /// The same for a payload laid out by hand: the generated types cannot hold numbers that their enumerations do not
    /// list.
    pub fn raw_frame(&mut self, message_id: u32, payload: &[u8]) -> Vec<u8> {
        let sequence = self.sequence;
        self.sequence = self.sequence.wrapping_add(1);
        frame_v2(self.address, sequence, message_id, payload)
    }
}

/// MAVLink guide, "Packet Serialization": trailing zeros of the payload are not sent, but its first byte always.
fn frame_v2(sender: Address, sequence: u8, message_id: u32, payload: &[u8]) -> Vec<u8> {
    let used = payload.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1);
    let payload = if payload.is_empty() { &[0][..] } else { &payload[..used] };
    let [id0, id1, id2, _] = message_id.to_le_bytes();
    let mut bytes =
        vec![0xFD, payload.len() as u8, 0, 0, sequence, sender.system, sender.component, id0, id1, id2];
    bytes.extend_from_slice(payload);
    finish(bytes, message_id)
}

fn finish(mut bytes: Vec<u8>, message_id: u32) -> Vec<u8> {
    let crc = mavlink::calculate_crc(&bytes[1..], MavMessage::extra_crc(message_id));
    bytes.extend_from_slice(&crc.to_le_bytes());
    bytes
}

/// A received frame as it was sent, without its signature: what a router passes on.
pub(crate) fn relayed(frame: &Frame) -> Vec<u8> {
    match frame.version {
        // A signature sets a flag that the checksum covers.
        WireVersion::V2 if frame.signature.is_some() => {
            frame_v2(frame.sender, frame.sequence, frame.message_id, frame.payload())
        }
        WireVersion::V2 => {
            let (Address { system, component }, payload) = (frame.sender, frame.payload());
            let [id0, id1, id2, _] = frame.message_id.to_le_bytes();
            let mut bytes = Vec::with_capacity(payload.len() + 12);
            bytes.extend_from_slice(&[0xFD, payload.len() as u8, 0, frame.compatibility, frame.sequence]);
            bytes.extend_from_slice(&[system, component, id0, id1, id2]);
            bytes.extend_from_slice(payload);
            bytes.extend_from_slice(&frame.checksum.to_le_bytes());
            bytes
        }
        WireVersion::V1 => {
            let Address { system, component } = frame.sender;
            let length = frame.payload().len() as u8;
            let mut bytes = vec![0xFE, length, frame.sequence, system, component, frame.message_id as u8];
            bytes.extend_from_slice(frame.payload());
            finish(bytes, frame.message_id)
        }
    }
}

/// The frame as this message; `None` for another one, and for enumeration values that the definitions do not list.
pub(crate) fn parse<D: MessageData>(frame: &Frame) -> Option<D> {
    if frame.message_id != D::ID {
        return None;
    }
    // Short MAVLink 1 payloads do not exist, so zero extension reads both versions.
    D::deser(MavlinkVersion::V2, frame.payload()).ok()
}

/// The target of a frame; 0 is broadcast.
pub(crate) fn target(frame: &Frame) -> Address {
    let at = |system: usize| {
        let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
        Address::new(byte(system), byte(system + 1))
    };
    match frame.message_id {
        // COMMAND_INT, COMMAND_LONG, COMMAND_ACK, SET_POSITION_TARGET_LOCAL_NED and TUNNEL may hold numbers that the
        // generated types refuse.
        75 | 76 => at(30),
        77 => at(8),
        84 => at(50),
        385 => at(2),
        _ => match MavMessage::parse(MavlinkVersion::V2, frame.message_id, frame.payload()) {
            Ok(message) => Address::new(
                message.target_system_id().unwrap_or(0),
                message.target_component_id().unwrap_or(0),
            ),
            Err(_) => Address::ALL,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_link::FrameDecoder;
    use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd};

    fn decode(bytes: &[u8]) -> Frame {
        let mut rest = bytes;
        let frame = FrameDecoder::new().read(&mut rest).expect("a whole frame");
        assert!(rest.is_empty());
        frame
    }

    #[test]
    fn relayed_frames_are_identical() {
        let mut speaker = Speaker::new(Address::new(255, 190));
        let command = COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_USER_2,
            param1: 1.0,
            target_system: 7,
            target_component: 191,
            ..COMMAND_LONG_DATA::DEFAULT
        };
        let bytes = speaker.frame(&command);
        let frame = decode(&bytes);
        assert_eq!(relayed(&frame), bytes);
        assert_eq!(target(&frame), Address::new(7, 191));
        assert_eq!(parse::<COMMAND_LONG_DATA>(&frame), Some(command.clone()));
        assert_eq!(decode(&speaker.frame(&command)).sequence, 1);
    }

    #[test]
    fn unlisted_numbers_have_a_target() {
        let mut speaker = Speaker::new(Address::new(1, 191));
        // Payload type 40001 is none of the listed ones.
        let mut payload = [0; 133];
        payload[..7].copy_from_slice(&[0x41, 0x9C, 255, 190, 2, 5, 6]);
        let bytes = speaker.raw_frame(385, &payload);
        assert_eq!(target(&decode(&bytes)), Address::new(255, 190));
        assert_eq!(relayed(&decode(&bytes)), bytes);
    }
}
