//! Raw little-endian fields of a payload.
//!
//! The generated types of the dialect refuse a whole message when one enumeration holds a value that they do
//! not list. A newer autopilot's heartbeat, a command we have never heard of (which must be answered) and a
//! local tunnel type are all of that kind, so those few messages are read and written field by field. So are
//! the fields that MAVLink 2 added to older messages: on board the generated types come without them.

/// Read access by offset. Bytes beyond the end are zero: MAVLink 2 cuts trailing zeros off.
#[derive(Clone, Copy)]
pub(crate) struct Fields<'a>(pub &'a [u8]);

impl Fields<'_> {
    fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        let rest = self.0.get(at..).unwrap_or(&[]);
        rest.first_chunk().copied().unwrap_or_else(|| {
            let mut bytes = [0; N];
            for (byte, source) in bytes.iter_mut().zip(rest) {
                *byte = *source;
            }
            bytes
        })
    }

    pub fn u8(&self, at: usize) -> u8 {
        self.0.get(at).copied().unwrap_or(0)
    }

    pub fn i8(&self, at: usize) -> i8 {
        i8::from_le_bytes(self.array(at))
    }

    pub fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.array(at))
    }

    pub fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.array(at))
    }

    pub fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.array(at))
    }

    pub fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.array(at))
    }

    pub fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.array(at))
    }

    pub fn f32(&self, at: usize) -> f32 {
        f32::from_le_bytes(self.array(at))
    }
}
