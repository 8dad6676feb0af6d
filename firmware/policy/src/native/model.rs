//! A blob as a model: identity, golden pairs and weights.

use super::format::{
    CRC_BYTES, FORMAT, LENGTH_END, MAGIC, NAME_BYTES, SHAPE, SOURCE_BYTES, VERSION_BYTES, WeightFormat, crc32,
};
use super::network::Network;
use super::reader::{BlobError, Reader};
use super::shape::{GOLDEN_WORDS, PANEL};
use crate::{Golden, K_MAX, LOCAL_MAP_CELLS, Tokens, schema};
use zerocopy::FromBytes;

/// A view of a blob's bytes as a model.
#[derive(Clone, Copy)]
pub struct Model<'m> {
    name: &'m str,
    version: &'m str,
    source: &'m [u8; SOURCE_BYTES],
    goldens: &'m [[u32; GOLDEN_WORDS]],
    pub(super) weights: Weights<'m>,
}

/// The network in one of the weight formats.
#[derive(Clone, Copy)]
pub(super) enum Weights<'m> {
    F32(Network<'m, [f32; PANEL]>),
    I16(Network<'m, [i16; PANEL]>),
}

impl<'m> Model<'m> {
    /// Reads a blob that is aligned to four bytes (see [`super::Aligned`]) without copying it.
    ///
    /// # Errors
    /// [`BlobError`] for any bytes that are not a valid model of this program. Never panics.
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

    /// Name of the model.
    #[must_use]
    pub fn name(&self) -> &'m str {
        self.name
    }

    /// Version of the program that trained it.
    #[must_use]
    pub fn version(&self) -> &'m str {
        self.version
    }

    /// SHA-256 of the ONNX file's content, which identifies the model.
    #[must_use]
    pub fn source(&self) -> &'m [u8; SOURCE_BYTES] {
        self.source
    }

    /// Format of the weights.
    #[must_use]
    pub fn format(&self) -> WeightFormat {
        match self.weights {
            Weights::F32(_) => WeightFormat::F32,
            Weights::I16(_) => WeightFormat::I16,
        }
    }

    /// Golden pairs for [`crate::self_test`].
    pub fn goldens(&self) -> impl Iterator<Item = Golden> + use<'m> {
        self.goldens.iter().filter_map(golden)
    }
}

/// The bytes between length and checksum, after checking magic, format, length and checksum.
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

/// `None` if it has more than [`K_MAX`] devices.
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
