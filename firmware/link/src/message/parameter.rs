//! Parameter messages.

use super::{Message, MessageFault};
use crate::address::Address;
use crate::fields::Fields;
use heapless::String;

/// Name of a parameter: up to 16 characters, no NUL.
pub type ParameterName = String<16>;

/// Name or index in `PARAM_REQUEST_READ`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ParameterKey {
    /// By its index.
    Index(u16),
    /// By its name.
    Name(ParameterName),
}

/// A name field: up to 16 bytes, ended by NUL only when shorter.
fn name(payload: &[u8], at: usize) -> Result<ParameterName, MessageFault> {
    let mut name = ParameterName::new();
    for &byte in payload.get(at..).unwrap_or(&[]).iter().take(16).take_while(|&&byte| byte != 0) {
        if !byte.is_ascii_graphic() {
            return Err(MessageFault::Malformed);
        }
        name.push(char::from(byte)).map_err(|_| MessageFault::Malformed)?;
    }
    Ok(name)
}

pub(super) fn read_request(fields: Fields<'_>, payload: &[u8]) -> Result<Message, MessageFault> {
    // The index wins; a negative one means "by name" (MAVLink guide, "Parameter Protocol").
    let key = match u16::try_from(fields.i16(0)) {
        Ok(index) => ParameterKey::Index(index),
        Err(_) => ParameterKey::Name(name(payload, 4)?),
    };
    Ok(Message::ParameterRead { target: Address::new(fields.u8(2), fields.u8(3)), key })
}

pub(super) fn read_set(fields: Fields<'_>, payload: &[u8]) -> Result<Message, MessageFault> {
    Ok(Message::ParameterSet {
        target: Address::new(fields.u8(4), fields.u8(5)),
        name: name(payload, 6)?,
        value: fields.f32(0),
        kind: fields.u8(22),
    })
}
