//! Reading a blob front to back, and the reasons to refuse one.

use super::format::FORMAT;
use crate::K_MAX;
use core::fmt;
use zerocopy::{FromBytes, Immutable, KnownLayout};

/// Why a blob is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlobError {
    /// It is not aligned to four bytes: see [`super::Aligned`].
    Misaligned,
    /// It does not begin with [`super::MAGIC`].
    Magic,
    /// Its layout has another version.
    Format {
        /// The version in the file.
        found: u32,
    },
    /// Its size differs from its length field or from the size of its parts.
    Length {
        /// Expected bytes, at least.
        expected: usize,
        /// Bytes found.
        found: usize,
    },
    /// Its checksum is wrong.
    Checksum {
        /// Checksum in the file.
        sealed: u32,
        /// Checksum of the content.
        found: u32,
    },
    /// The model was trained for another observation contract.
    Schema {
        /// The model's hash.
        model: u64,
        /// [`crate::schema::hash`] of this program.
        program: u64,
    },
    /// The network has other sizes than this engine's.
    Shape,
    /// The format of the weights is unknown.
    Weights {
        /// The number in the file.
        found: u32,
    },
    /// Name or version is not UTF-8.
    Name,
    /// A golden pair has more than [`K_MAX`] devices.
    Golden {
        /// Index of the pair.
        pair: usize,
    },
}

impl fmt::Display for BlobError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BlobError::Misaligned => write!(f, "the model is not aligned to 4 bytes: align it")?,
            BlobError::Magic => write!(f, "not a model file of the native engine")?,
            BlobError::Format { found } => {
                write!(f, "the model has layout {found}, this program reads {FORMAT}")?
            }
            BlobError::Length { expected, found } => {
                write!(f, "the model has {found} bytes instead of {expected}")?;
            }
            BlobError::Checksum { sealed, found } => {
                write!(f, "damaged model: CRC {found:#010x} instead of {sealed:#010x}")?;
            }
            BlobError::Schema { model, program } => {
                write!(f, "schema {model:#018x} of the model is not this program's {program:#018x}")?;
            }
            BlobError::Shape => write!(f, "the model's network has other sizes than this program's")?,
            BlobError::Weights { found } => write!(f, "the model's weights have the unknown format {found}")?,
            BlobError::Name => write!(f, "the model's name is not UTF-8")?,
            BlobError::Golden { pair } => write!(f, "golden pair {pair} has more than {K_MAX} devices")?,
        }
        match self {
            BlobError::Misaligned => Ok(()),
            _ => write!(f, ": convert it again with `gleaner convert`"),
        }
    }
}

impl core::error::Error for BlobError {}

/// The bytes not yet read.
pub(super) struct Reader<'m> {
    pub rest: &'m [u8],
    /// Bytes of the whole blob.
    pub length: usize,
}

impl<'m> Reader<'m> {
    /// The next part, by reference.
    pub fn take<T: FromBytes + Immutable + KnownLayout>(&mut self) -> Result<&'m T, BlobError> {
        let (part, rest) = T::ref_from_prefix(self.rest).map_err(|_| self.length_error(size_of::<T>()))?;
        self.rest = rest;
        Ok(part)
    }

    pub fn word(&mut self) -> Result<u32, BlobError> {
        self.take().map(|bytes| u32::from_le_bytes(*bytes))
    }

    /// The error for a blob that lacks `bytes` after the part read last.
    pub fn length_error(&self, bytes: usize) -> BlobError {
        let before = self.length.saturating_sub(self.rest.len());
        BlobError::Length { expected: before.saturating_add(bytes), found: self.length }
    }
}
