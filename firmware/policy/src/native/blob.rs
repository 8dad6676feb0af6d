//! The model file of the native engine, read where it lies.
//!
//! Everything is little-endian; every part begins at a multiple of four bytes.
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
//! | | | weights, in the order of `Network` |
//! | last | 4 | CRC-32 (ISO-HDLC) of all before |

use super::network::Network;
use super::{FEED_FORWARD, HEAD_HIDDEN, HEADS, LAYERS, PANEL, WIDTH};
use crate::tokens::{DEVICE_FEATURES, UAV_FEATURES};
use crate::{Golden, K_MAX, LOCAL_MAP_CELLS, Tokens, schema};
use core::fmt;
use gleaner_units::Action;
#[cfg(feature = "std")]
use zerocopy::IntoBytes;
use zerocopy::{FromBytes, Immutable, KnownLayout};

/// The first bytes. As in PNG: a copy that changes line ends or drops the eighth bit breaks them.
pub const MAGIC: [u8; 8] = *b"\x89GLN\r\n\x1a\n";
/// Version of the layout.
pub const FORMAT: u32 = 1;
/// Bytes of a SHA-256.
pub(crate) const SOURCE_BYTES: usize = 32;
const NAME_BYTES: usize = 32;
const VERSION_BYTES: usize = 16;
const CRC_BYTES: usize = 4;
/// Where the length stands, and how many bytes are read before it is known.
const LENGTH_END: usize = 16;
const GOLDEN_WORDS: usize = UAV_FEATURES + 2 + LOCAL_MAP_CELLS + 1 + K_MAX * DEVICE_FEATURES + Action::COUNT;
/// What this engine computes.
const SHAPE: [u32; 8] = [
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

/// Bytes that begin at a multiple of four, as [`Model::read`] wants them:
/// `static BLOB: &Aligned<[u8]> = &Aligned(*include_bytes!("model.gln"));`
#[derive(Clone, Copy, Debug)]
#[repr(C, align(4))]
pub struct Aligned<T: ?Sized>(pub T);

/// A copy of some bytes that begins at a multiple of four, for a program that reads a file.
#[cfg(feature = "std")]
#[derive(Clone, Debug)]
pub struct AlignedBytes {
    words: Vec<u32>,
    length: usize,
}

#[cfg(feature = "std")]
impl AlignedBytes {
    /// Copies.
    #[must_use]
    pub fn new(bytes: &[u8]) -> AlignedBytes {
        let mut words = vec![0_u32; bytes.len().div_ceil(size_of::<u32>())];
        for (to, from) in words.as_mut_bytes().iter_mut().zip(bytes) {
            *to = *from;
        }
        AlignedBytes { words, length: bytes.len() }
    }

    /// The bytes.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.words.as_bytes().get(..self.length).unwrap_or_default()
    }
}

/// How the weights of the linear layers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum WeightFormat {
    /// As they were learned.
    F32 = 0,
    /// 16 bits and a scale for each output: half the flash. Shorter weights decide otherwise too often.
    I16 = 1,
}

impl WeightFormat {
    /// All of them.
    pub const ALL: [WeightFormat; 2] = [WeightFormat::F32, WeightFormat::I16];

    /// As it is written on a command line.
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

    fn from_wire(number: u32) -> Option<WeightFormat> {
        WeightFormat::ALL.into_iter().find(|format| *format as u32 == number)
    }
}

/// Why a blob is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlobError {
    /// It does not begin at a multiple of four bytes: see [`Aligned`].
    Misaligned,
    /// It does not begin with [`MAGIC`].
    Magic,
    /// It is of another layout.
    Format {
        /// Its version of the layout.
        found: u32,
    },
    /// It is longer or shorter than it says, or than its parts need.
    Length {
        /// How many bytes it should have, at least.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// It is damaged.
    Checksum {
        /// What the file says.
        sealed: u32,
        /// What its content has.
        found: u32,
    },
    /// It was trained for another observation contract.
    Schema {
        /// The model's.
        model: u64,
        /// [`schema::hash`] of this program.
        program: u64,
    },
    /// The network has other sizes.
    Shape,
    /// The weights are stored in a way that this program does not know.
    Weights {
        /// What the file says.
        found: u32,
    },
    /// Name or version is no text.
    Name,
    /// A golden pair has more devices than fit.
    Golden {
        /// Which one.
        pair: usize,
    },
}

impl fmt::Display for BlobError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BlobError::Misaligned => {
                write!(f, "the model does not begin at a multiple of 4 bytes: align it")?
            }
            BlobError::Magic => write!(f, "not a model of the native engine")?,
            BlobError::Format { found } => write!(f, "layout {found} of the model is not {FORMAT}")?,
            BlobError::Length { expected, found } => {
                write!(f, "the model has {found} bytes instead of {expected}")?;
            }
            BlobError::Checksum { sealed, found } => {
                write!(f, "damaged model: its content has CRC {found:#010x}, sealed was {sealed:#010x}")?;
            }
            BlobError::Schema { model, program } => {
                write!(f, "schema {model:#018x} of the model is not this program's {program:#018x}")?;
            }
            BlobError::Shape => write!(f, "the model's network has other sizes than this engine's")?,
            BlobError::Weights { found } => write!(f, "the model has weights of unknown format {found}")?,
            BlobError::Name => write!(f, "the model's name is no text")?,
            BlobError::Golden { pair } => write!(f, "golden pair {pair} has more than {K_MAX} devices")?,
        }
        match self {
            BlobError::Misaligned => Ok(()),
            _ => write!(f, ": convert it again with `gleaner convert`"),
        }
    }
}

impl core::error::Error for BlobError {}

/// Takes a blob apart from front to back.
pub(super) struct Reader<'m> {
    rest: &'m [u8],
    length: usize,
}

impl<'m> Reader<'m> {
    /// The next part, in place.
    pub fn take<T: FromBytes + Immutable + KnownLayout>(&mut self) -> Result<&'m T, BlobError> {
        let (part, rest) = T::ref_from_prefix(self.rest).map_err(|_| self.length_error(size_of::<T>()))?;
        self.rest = rest;
        Ok(part)
    }

    fn word(&mut self) -> Result<u32, BlobError> {
        self.take().map(|bytes| u32::from_le_bytes(*bytes))
    }

    /// The parts do not fill the file exactly: another `bytes` were to come.
    fn length_error(&self, bytes: usize) -> BlobError {
        let before = self.length.saturating_sub(self.rest.len());
        BlobError::Length { expected: before.saturating_add(bytes), found: self.length }
    }
}

/// What stands before the golden pairs.
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
    /// The bytes; the length is that of the whole file.
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

/// A model in the form of the native engine; a view of the blob's bytes.
#[derive(Clone, Copy)]
pub struct Model<'m> {
    name: &'m str,
    version: &'m str,
    source: &'m [u8; SOURCE_BYTES],
    goldens: &'m [[u32; GOLDEN_WORDS]],
    pub(super) weights: Weights<'m>,
}

/// The network in one of the formats.
#[derive(Clone, Copy)]
pub(super) enum Weights<'m> {
    F32(Network<'m, [f32; PANEL]>),
    I16(Network<'m, [i16; PANEL]>),
}

impl<'m> Model<'m> {
    /// Reads a blob that begins at a multiple of four bytes (see [`Aligned`]); nothing is copied.
    ///
    /// # Errors
    /// Anything that is not exactly such a file for this program, see [`BlobError`]. No bytes make it panic.
    ///
    /// # Cost
    /// One pass over the bytes for the checksum, about ten instructions each.
    pub fn read(bytes: &'m [u8]) -> Result<Model<'m>, BlobError> {
        if bytes.as_ptr().align_offset(4) != 0 {
            return Err(BlobError::Misaligned);
        }
        let mut reader = Reader { rest: checked_content(bytes)?, length: bytes.len() };
        let schema = u64::from_le_bytes(*reader.take()?);
        if schema != schema::hash() {
            return Err(BlobError::Schema { model: schema, program: schema::hash() });
        }
        if *reader.take::<[u32; 8]>()? != SHAPE {
            return Err(BlobError::Shape);
        }
        let weights = reader.word()?;
        let weights = WeightFormat::from_wire(weights).ok_or(BlobError::Weights { found: weights })?;
        let goldens = reader.word()? as usize;
        let source = reader.take()?;
        let name = text(reader.take::<[u8; NAME_BYTES]>()?)?;
        let version = text(reader.take::<[u8; VERSION_BYTES]>()?)?;
        let goldens = take_goldens(&mut reader, goldens)?;
        let weights = match weights {
            WeightFormat::F32 => Weights::F32(Network::read(&mut reader)?),
            WeightFormat::I16 => Weights::I16(Network::read(&mut reader)?),
        };
        if !reader.rest.is_empty() {
            return Err(reader.length_error(0));
        }
        Ok(Model { name, version, source, goldens, weights })
    }

    /// What people call it.
    #[must_use]
    pub fn name(&self) -> &'m str {
        self.name
    }

    /// Version of the program that trained it.
    #[must_use]
    pub fn version(&self) -> &'m str {
        self.version
    }

    /// SHA-256 of the ONNX file's content: the identity of the model.
    #[must_use]
    pub fn source(&self) -> &'m [u8; SOURCE_BYTES] {
        self.source
    }

    /// How its weights are stored.
    #[must_use]
    pub fn format(&self) -> WeightFormat {
        match self.weights {
            Weights::F32(_) => WeightFormat::F32,
            Weights::I16(_) => WeightFormat::I16,
        }
    }

    /// What the model must answer, for [`crate::self_test`].
    pub fn goldens(&self) -> impl Iterator<Item = Golden> + use<'m> {
        self.goldens.iter().filter_map(golden)
    }
}

/// The bytes between length and checksum, when magic, format, length and checksum are right.
fn checked_content(bytes: &[u8]) -> Result<&[u8], BlobError> {
    let too_short =
        BlobError::Length { expected: LENGTH_END.max(bytes.len().saturating_add(1)), found: bytes.len() };
    let (magic, _) = bytes.split_first_chunk().ok_or(too_short)?;
    if *magic != MAGIC {
        return Err(BlobError::Magic);
    }
    let mut reader = Reader { rest: bytes.get(MAGIC.len()..).ok_or(too_short)?, length: bytes.len() };
    let format = reader.word().map_err(|_| too_short)?;
    if format != FORMAT {
        return Err(BlobError::Format { found: format });
    }
    let length = reader.word().map_err(|_| too_short)? as usize;
    if length != bytes.len() {
        return Err(BlobError::Length { expected: length, found: bytes.len() });
    }
    let (content, sealed) = bytes.split_last_chunk::<CRC_BYTES>().ok_or(too_short)?;
    let (sealed, found) = (u32::from_le_bytes(*sealed), crc32(content));
    if sealed != found {
        return Err(BlobError::Checksum { sealed, found });
    }
    content.get(LENGTH_END..).ok_or(too_short)
}

fn text(bytes: &[u8]) -> Result<&str, BlobError> {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let (text, _) = bytes.split_at_checked(end).ok_or(BlobError::Name)?;
    core::str::from_utf8(text).map_err(|_| BlobError::Name)
}

fn take_goldens<'m>(reader: &mut Reader<'m>, count: usize) -> Result<&'m [[u32; GOLDEN_WORDS]], BlobError> {
    let goldens = <[[u32; GOLDEN_WORDS]]>::ref_from_prefix_with_elems(reader.rest, count);
    let bytes = count.saturating_mul(size_of::<[u32; GOLDEN_WORDS]>());
    let (goldens, rest) = goldens.map_err(|_| reader.length_error(bytes))?;
    reader.rest = rest;
    match goldens.iter().position(|words| golden(words).is_none()) {
        Some(pair) => Err(BlobError::Golden { pair }),
        None => Ok(goldens),
    }
}

/// `None` when it claims more devices than fit.
fn golden(words: &[u32; GOLDEN_WORDS]) -> Option<Golden> {
    let mut words = words.iter().copied();
    let mut tokens = Tokens {
        uav: take_numbers(&mut words)?,
        preference: take_numbers(&mut words)?,
        local_map: take_numbers::<LOCAL_MAP_CELLS>(&mut words)?.into_iter().collect(),
        devices: heapless::Vec::new(),
    };
    let count = words.next()? as usize;
    for slot in 0..K_MAX {
        let device = take_numbers(&mut words)?;
        if slot < count {
            tokens.devices.push(device).ok()?;
        }
    }
    let logits = take_numbers(&mut words)?;
    (count <= K_MAX).then_some(Golden { tokens, logits })
}

fn take_numbers<const N: usize>(words: &mut impl Iterator<Item = u32>) -> Option<[f32; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = f32::from_bits(words.next()?);
    }
    Some(numbers)
}
