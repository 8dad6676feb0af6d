//! Finished parts of a long measurement, kept in a folder so that an interrupted measurement continues.
//!
//! The name of a part is a hash of its inputs: the model, the setting, the number of realizations. When an input changes,
//! the name changes and the part is measured again.

use crate::keep::checkpoint::{self, CheckpointError};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};
use std::fs;
use std::path::{Path, PathBuf};

/// Increment when equal inputs may give other numbers than before, so that old parts are measured again.
const GENERATION: u32 = 2;

/// The folder of the parts.
#[derive(Clone, Debug)]
pub struct Parts {
    folder: PathBuf,
}

/// Where a part came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The folder.
    Kept,
    /// A new measurement.
    Measured,
    /// A new measurement, since the file was damaged.
    Repaired,
}

impl Parts {
    /// Opens the folder; makes it if it does not exist.
    ///
    /// # Errors
    /// The file system.
    pub fn open(folder: &Path) -> Result<Parts, CheckpointError> {
        fs::create_dir_all(folder)
            .map_err(|source| CheckpointError::Io { path: folder.to_owned(), source })?;
        Ok(Parts { folder: folder.to_owned() })
    }

    /// The part with these inputs: from the folder, or from `measure` and then kept.
    ///
    /// # Errors
    /// Those of `measure`, and the file system.
    pub fn part<T: Serialize + DeserializeOwned, E: From<CheckpointError>>(
        &self,
        facts: &str,
        measure: impl FnOnce() -> Result<T, E>,
    ) -> Result<(T, Source), E> {
        let path = self.folder.join(format!("{}.part", name(facts)));
        let mut source = Source::Measured;
        if path.exists() {
            match checkpoint::load(&path) {
                Ok(part) => return Ok((part, Source::Kept)),
                Err(_) => source = Source::Repaired,
            }
        }
        let part = measure()?;
        checkpoint::save(&path, &part)?;
        Ok((part, source))
    }
}

fn name(facts: &str) -> String {
    let version = env!("CARGO_PKG_VERSION");
    fingerprint(format!("{GENERATION} {version} {facts}").as_bytes())
}

/// The first 16 hexadecimal digits of the SHA-256 of these bytes.
#[must_use]
pub fn fingerprint(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(parts: &Parts, facts: &str, value: u32) -> (u32, Source) {
        parts.part::<u32, CheckpointError>(facts, || Ok(value)).unwrap()
    }

    #[test]
    fn parts_are_measured_once_and_repaired() {
        let folder = tempfile::tempdir().unwrap();
        let parts = Parts::open(&folder.path().join("parts")).unwrap();
        assert_eq!(measured(&parts, "model a, rd", 1), (1, Source::Measured));
        assert_eq!(measured(&parts, "model a, rd", 2), (1, Source::Kept));
        assert_eq!(measured(&parts, "model b, rd", 3), (3, Source::Measured));

        let path = parts.folder.join(format!("{}.part", name("model a, rd")));
        let mut bytes = fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        fs::write(&path, &bytes).unwrap();
        assert_eq!(measured(&parts, "model a, rd", 4), (4, Source::Repaired));
        assert_eq!(measured(&parts, "model a, rd", 5), (4, Source::Kept));
    }

    #[test]
    fn a_measurement_that_fails_leaves_no_part() {
        let folder = tempfile::tempdir().unwrap();
        let parts = Parts::open(folder.path()).unwrap();
        let error = CheckpointError::Format { path: PathBuf::from("x") };
        assert!(parts.part::<u32, CheckpointError>("facts", || Err(error)).is_err());
        assert_eq!(measured(&parts, "facts", 7), (7, Source::Measured));
    }
}
