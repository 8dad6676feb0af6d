//! Checkpoints: binary files with a checksum, replaced atomically.

use crate::keep::whole;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// First bytes of a file: name and version of the format.
const MAGIC: &[u8; 8] = b"GLNCKPT1";
/// CRC-32 (IEEE 802.3) of the payload.
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Why a checkpoint cannot be used.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file system. The last good checkpoint, if any, is untouched.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// Not a checkpoint of this program.
    #[error("{}: not a checkpoint of this version; train into another --out folder", path.display())]
    Format {
        /// Which file.
        path: PathBuf,
    },
    /// The checksum does not match.
    #[error("{}: truncated or damaged; restore a copy of it, or delete it to start again", path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
    },
}

/// Writes `value` and replaces the file at `path` atomically.
///
/// # Errors
/// The file system, for example a full disk; the old checkpoint is then still there.
pub fn save<T: Serialize>(path: &Path, value: &T) -> Result<(), CheckpointError> {
    let io = |source| CheckpointError::Io { path: path.to_owned(), source };
    let payload = postcard::to_stdvec(value).map_err(|error| io(io::Error::other(error)))?;
    let length = (payload.len() as u64).to_le_bytes();
    let bytes = [MAGIC, &length[..], &CRC.checksum(&payload).to_le_bytes(), &payload].concat();
    whole::write(path, &bytes).map_err(io)
}

/// As [`save`], with a name before the value.
///
/// # Errors
/// Those of [`save`].
pub fn save_named<T: Serialize>(path: &Path, name: &str, value: &T) -> Result<(), CheckpointError> {
    save(path, &(name, value))
}

/// A checkpoint with its name, before its value is decoded.
#[derive(Debug)]
pub struct Named {
    path: PathBuf,
    name: String,
    payload: Vec<u8>,
    /// Offset of the value in the payload.
    value_at: usize,
}

impl Named {
    /// The name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Decodes the value.
    ///
    /// # Errors
    /// It has another type or version.
    pub fn value<T: DeserializeOwned>(&self) -> Result<T, CheckpointError> {
        match postcard::take_from_bytes(&self.payload[self.value_at..]) {
            Ok((value, [])) => Ok(value),
            Ok(_) | Err(_) => Err(CheckpointError::Format { path: self.path.clone() }),
        }
    }
}

/// Reads a file of [`save_named`].
///
/// # Errors
/// See [`CheckpointError`].
pub fn load_named(path: &Path) -> Result<Named, CheckpointError> {
    let payload = payload(path)?;
    let (name, rest) = postcard::take_from_bytes::<String>(&payload)
        .map_err(|_| CheckpointError::Format { path: path.to_owned() })?;
    let value_at = payload.len() - rest.len();
    Ok(Named { path: path.to_owned(), name, payload, value_at })
}

/// Reads a file of [`save`].
///
/// # Errors
/// See [`CheckpointError`].
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T, CheckpointError> {
    postcard::from_bytes(&payload(path)?).map_err(|_| CheckpointError::Format { path: path.to_owned() })
}

/// The payload of an undamaged file.
fn payload(path: &Path) -> Result<Vec<u8>, CheckpointError> {
    let io = |source| CheckpointError::Io { path: path.to_owned(), source };
    let mut bytes = Vec::new();
    File::open(path).map_err(io)?.read_to_end(&mut bytes).map_err(io)?;
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| CheckpointError::Format { path: path.to_owned() })?;
    let damaged = || CheckpointError::Damaged { path: path.to_owned() };
    let (len, rest) = rest.split_first_chunk::<8>().ok_or_else(damaged)?;
    let (crc, payload) = rest.split_first_chunk::<4>().ok_or_else(damaged)?;
    let whole =
        u64::from_le_bytes(*len) == payload.len() as u64 && u32::from_le_bytes(*crc) == CRC.checksum(payload);
    if whole { Ok(payload.to_vec()) } else { Err(damaged()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn checkpoints_load_and_damage_is_detected() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        let value: Vec<f32> = (0..1000).map(|i| i as f32 * 0.25).collect();
        save(&path, &value).unwrap();
        assert_eq!(load::<Vec<f32>>(&path).unwrap(), value);

        let good = fs::read(&path).unwrap();
        for cut in [0, 7, 8, 15, 19, 20, good.len() / 2, good.len() - 1] {
            fs::write(&path, &good[..cut]).unwrap();
            assert!(load::<Vec<f32>>(&path).is_err(), "cut at {cut}");
        }
        let mut flipped = good.clone();
        flipped[500] ^= 1;
        fs::write(&path, &flipped).unwrap();
        assert!(matches!(load::<Vec<f32>>(&path), Err(CheckpointError::Damaged { .. })));
    }

    #[test]
    fn named_checkpoints_must_be_decoded_completely() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        save_named(&path, "mosac-cgl", &(7u32, 0.5f32)).unwrap();
        let named = load_named(&path).unwrap();
        assert_eq!(named.name(), "mosac-cgl");
        assert_eq!(named.value::<(u32, f32)>().unwrap(), (7, 0.5));
        assert!(matches!(named.value::<u32>(), Err(CheckpointError::Format { .. })), "four bytes are left");
        save(&path, &u64::MAX).unwrap();
        assert!(matches!(load_named(&path), Err(CheckpointError::Format { .. })));
    }

    #[test]
    fn failed_write_keeps_the_old_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        save(&path, &1u32).unwrap();
        // A folder at the path of the temporary file makes the write fail.
        fs::create_dir(path.with_extension("writing")).unwrap();
        assert!(matches!(save(&path, &2u32), Err(CheckpointError::Io { .. })));
        assert_eq!(load::<u32>(&path).unwrap(), 1);
    }
}
