//! Reading and writing the checkpoint of a run: settings as JSON, then the state of the trainer.
//!
//! A checkpoint starts with a name, the system or the way of learning, and the version of its format. Version 1 had no
//! version in its name and the settings as a bare structure; its files are still read.

use crate::keep::checkpoint::{self, CheckpointError, Named};
use crate::learn::trainer::TrainError;
use crate::settings::{Settings, SettingsV1, as_json};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Version of the checkpoint's format, at the end of its name.
const VERSION: &str = "/2";

#[derive(Serialize, Deserialize)]
#[serde(bound(serialize = "T: Serialize", deserialize = "T: DeserializeOwned"))]
struct Stored<T> {
    #[serde(with = "as_json")]
    settings: Settings,
    state: T,
}

#[derive(Serialize)]
struct StoredRef<'a, T> {
    #[serde(with = "as_json")]
    settings: &'a Settings,
    state: &'a T,
}

#[derive(Deserialize)]
#[serde(bound = "T: DeserializeOwned")]
struct StoredV1<T> {
    settings: SettingsV1,
    state: T,
}

/// Writes a checkpoint.
pub(super) fn save<T: Serialize>(
    path: &Path,
    name: &str,
    settings: &Settings,
    state: &T,
) -> Result<(), CheckpointError> {
    checkpoint::save_named(path, &format!("{name}{VERSION}"), &StoredRef { settings, state })
}

/// Reads the state of the run in `path`; `None` if there is no file. The settings must be those of the run, except for
/// the number of updates: a finished run may be prolonged.
pub(super) fn load<T: DeserializeOwned>(
    path: &Path,
    name: &str,
    settings: &Settings,
) -> Result<Option<T>, TrainError> {
    if !path.exists() {
        return Ok(None);
    }
    let named = checkpoint::load_named(path);
    let (found, state) = match named {
        Ok(named) if named.name() == format!("{name}{VERSION}") => {
            let Stored { settings, state } = named.value()?;
            (settings, state)
        }
        Ok(named) if named.name() == name => split(named.value()?),
        Ok(named) if is_a_name(&named) => {
            let found = named.name().trim_end_matches(VERSION).to_owned();
            return Err(TrainError::OtherSystem { path: path.to_owned(), found });
        }
        Err(error @ (CheckpointError::Io { .. } | CheckpointError::Damaged { .. })) => {
            return Err(error.into());
        }
        // Version 1 of distil and refine had no name.
        Ok(_) | Err(_) => split(checkpoint::load(path)?),
    };
    let found = Settings { updates: settings.updates, ..found };
    match found.difference(settings) {
        None => Ok(Some(state)),
        Some(difference) => Err(TrainError::OtherSettings { path: path.to_owned(), difference }),
    }
}

fn split<T>(stored: StoredV1<T>) -> (Settings, T) {
    (stored.settings.into(), stored.state)
}

/// Whether a file without a matching name is a checkpoint of another system and not a file without a name.
fn is_a_name(named: &Named) -> bool {
    let name = named.name().trim_end_matches(VERSION);
    name.len() > 3 && name.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-')
}

#[cfg(test)]
mod tests {
    use super::*;

    type State = (Vec<f32>, u64);

    fn state() -> State {
        (vec![1.0, -2.5], 1 << 40)
    }

    fn settings() -> Settings {
        Settings { seed: 3, updates: 375_000, heat_in_policy: true, ..Settings::default() }
    }

    #[test]
    fn checkpoints_of_version_1_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        let old = (SettingsV1::from(settings()), state());
        checkpoint::save_named(&path, "mosac-att", &old).unwrap();
        assert_eq!(load::<State>(&path, "mosac-att", &settings()).unwrap(), Some(state()));
        let error = load::<State>(&path, "mosac-ftv", &settings()).unwrap_err();
        assert!(
            matches!(error, TrainError::OtherSystem { ref found, .. } if found == "mosac-att"),
            "{error}"
        );
        // distil and refine wrote no name.
        for seed in [1, 3, 5, 200] {
            let settings = Settings { seed, ..settings() };
            checkpoint::save(&path, &(SettingsV1::from(settings.clone()), state())).unwrap();
            assert_eq!(load::<State>(&path, "distil", &settings).unwrap(), Some(state()), "seed {seed}");
        }
    }

    #[test]
    fn other_settings_are_refused_and_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        assert_eq!(load::<State>(&path, "distil", &settings()).unwrap(), None);
        save(&path, "distil", &settings(), &state()).unwrap();
        assert_eq!(load::<State>(&path, "distil", &settings()).unwrap(), Some(state()));
        let longer = Settings { updates: 400_000, ..settings() };
        assert_eq!(load::<State>(&path, "distil", &longer).unwrap(), Some(state()));
        let other = Settings { discount: 0.9, ..settings() };
        let error = load::<State>(&path, "distil", &other).unwrap_err().to_string();
        assert!(error.contains("discount: 0.99 there, 0.9 here"), "{error}");
    }
}
