//! A file that survives a kill: written beside the last good one, renamed over it when it is whole.

use crate::keep::whole;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// First bytes of a checkpoint: name and version of the format.
const MAGIC: &[u8; 8] = b"GLNCKPT1";
/// CRC-32 as in IEEE 802.3, over the payload.
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Why a checkpoint cannot be used.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file system's own reason. The last good checkpoint, if there is one, is untouched.
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
    /// The content is not what was written.
    #[error("{}: truncated or damaged; delete it and resume from the copy of it that you keep, or start anew", path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
    },
}

/// Writes `value` so that `path` is at every moment either the old checkpoint or the new one.
///
/// # Errors
/// A full disk, mostly. The old checkpoint is then still there.
pub fn save<T: Serialize>(path: &Path, value: &T) -> Result<(), CheckpointError> {
    let io = |source| CheckpointError::Io { path: path.to_owned(), source };
    let payload = postcard::to_stdvec(value).map_err(|error| io(io::Error::other(error)))?;
    let length = (payload.len() as u64).to_le_bytes();
    let bytes = [MAGIC, &length[..], &CRC.checksum(&payload).to_le_bytes(), &payload].concat();
    whole::write(path, &bytes).map_err(io)
}

/// [`save`], with the name of what the value belongs to before it.
///
/// # Errors
/// Those of [`save`].
pub fn save_named<T: Serialize>(path: &Path, name: &str, value: &T) -> Result<(), CheckpointError> {
    save(path, &(name, value))
}

/// A checkpoint whose name is known and whose value is not yet.
#[derive(Debug)]
pub struct Named {
    path: PathBuf,
    name: String,
    payload: Vec<u8>,
    /// Where the value begins in the payload.
    value_at: usize,
}

impl Named {
    /// What the value belongs to.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The value.
    ///
    /// # Errors
    /// It is of another type or version.
    pub fn value<T: DeserializeOwned>(&self) -> Result<T, CheckpointError> {
        match postcard::take_from_bytes(&self.payload[self.value_at..]) {
            Ok((value, [])) => Ok(value),
            Ok(_) | Err(_) => Err(CheckpointError::Format { path: self.path.clone() }),
        }
    }
}

/// Reads what [`save_named`] wrote.
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

/// Reads a checkpoint back.
///
/// # Errors
/// See [`CheckpointError`].
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T, CheckpointError> {
    postcard::from_bytes(&payload(path)?).map_err(|_| CheckpointError::Format { path: path.to_owned() })
}

/// The payload of a file that is whole.
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
    fn a_checkpoint_comes_back_and_damage_is_noticed() {
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
    fn a_named_checkpoint_tells_its_name_first_and_leaves_nothing_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        save_named(&path, "mosac-cgl", &(7u32, 0.5f32)).unwrap();
        let named = load_named(&path).unwrap();
        assert_eq!(named.name(), "mosac-cgl");
        assert_eq!(named.value::<(u32, f32)>().unwrap(), (7, 0.5));
        assert!(matches!(named.value::<u32>(), Err(CheckpointError::Format { .. })), "four bytes left over");
        save(&path, &u64::MAX).unwrap();
        assert!(matches!(load_named(&path), Err(CheckpointError::Format { .. })));
    }

    #[test]
    fn a_write_that_fails_leaves_the_old_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        save(&path, &1u32).unwrap();
        // A folder in the way of the temporary file stands for a disk that cannot be written.
        fs::create_dir(path.with_extension("writing")).unwrap();
        assert!(matches!(save(&path, &2u32), Err(CheckpointError::Io { .. })));
        assert_eq!(load::<u32>(&path).unwrap(), 1);
    }
}
