//! The model file of the native engine (`.gln`): layout, header and checksum.
//!
//! Numbers are little-endian, and every part is aligned to four bytes.
//!
//! | offset | bytes | |
//! |---|---|---|
//! | 0 | 8 | [`MAGIC`] |
//! | 8 | 4 | [`FORMAT`] |
//! | 12 | 4 | length of the file |
//! | 16 | 8 | schema hash |
//! | 24 | 32 | shape: devices, map cells, width, heads, layers, feed-forward, head, actions |
//! | 56 | 4 | [`WeightFormat`] |
//! | 60 | 4 | number of golden pairs |
//! | 64 | 32 | SHA-256 of the ONNX file's content |
//! | 96 | 32, 16 | name and version, UTF-8, filled with zeros |
//! | 144 | 688 each | golden pairs: aircraft, preference, map, number of devices, devices, logits |
//! | | | weights, in the order of `network::Network` |
//! | last | 4 | CRC-32 (ISO-HDLC) of all bytes before it |

use super::shape::{FEED_FORWARD, HEAD_HIDDEN, HEADS, LAYERS, WIDTH};
#[cfg(feature = "std")]
use crate::schema;
use crate::{K_MAX, LOCAL_MAP_CELLS};
use gleaner_units::Action;

/// The first bytes. As in PNG, a copy that converts line ends or clears the eighth bit damages them.
pub const MAGIC: [u8; 8] = *b"\x89GLN\r\n\x1a\n";
/// Version of the layout.
pub const FORMAT: u32 = 1;
/// Bytes of a SHA-256.
pub(crate) const SOURCE_BYTES: usize = 32;
pub(super) const NAME_BYTES: usize = 32;
pub(super) const VERSION_BYTES: usize = 16;
pub(super) const CRC_BYTES: usize = 4;
/// End of the length field: the bytes that are read before the length is known.
pub(super) const LENGTH_END: usize = 16;
/// The network that this engine computes.
pub(super) const SHAPE: [u32; 8] = [
    K_MAX as u32,
    LOCAL_MAP_CELLS as u32,
    WIDTH as u32,
    HEADS as u32,
    LAYERS as u32,
    FEED_FORWARD as u32,
    HEAD_HIDDEN as u32,
    Action::COUNT as u32,
];

static CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// The checksum at the end of a blob.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// How the weights of the linear layers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum WeightFormat {
    /// 32-bit floats, as trained.
    F32 = 0,
    /// 16-bit integers with a scale for each output: half the flash. With 8 bits too many decisions change.
    I16 = 1,
}

impl WeightFormat {
    /// All formats.
    pub const ALL: [WeightFormat; 2] = [WeightFormat::F32, WeightFormat::I16];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            WeightFormat::F32 => "f32",
            WeightFormat::I16 => "i16",
        }
    }

    /// The format with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<WeightFormat> {
        WeightFormat::ALL.into_iter().find(|format| format.name() == name)
    }

    pub(super) fn from_wire(number: u32) -> Option<WeightFormat> {
        WeightFormat::ALL.into_iter().find(|format| *format as u32 == number)
    }
}

/// The part before the golden pairs.
#[cfg(feature = "std")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Header {
    pub weights: WeightFormat,
    pub goldens: u32,
    pub source: [u8; SOURCE_BYTES],
    pub name: [u8; NAME_BYTES],
    pub version: [u8; VERSION_BYTES],
}

#[cfg(feature = "std")]
impl Header {
    /// The header's bytes; `length` is that of the whole file.
    pub fn to_bytes(self, length: u32) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(FORMAT.to_le_bytes());
        bytes.extend(length.to_le_bytes());
        bytes.extend(schema::hash().to_le_bytes());
        bytes.extend(SHAPE.iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend((self.weights as u32).to_le_bytes());
        bytes.extend(self.goldens.to_le_bytes());
        bytes.extend(self.source);
        bytes.extend(self.name);
        bytes.extend(self.version);
        bytes
    }
}
