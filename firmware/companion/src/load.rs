//! Files to checked values.

use crate::error::StartError;
use gleaner_pilot::{Mission, mission_file};
use gleaner_policy::{Engine, EngineKind};
use std::fs;
use std::path::Path;

/// The model, after it proved itself on its golden pairs.
pub fn model(path: &Path, engine: EngineKind) -> Result<Engine, StartError> {
    let bytes =
        fs::read(path).map_err(|source| StartError::Read { what: "model", path: path.to_owned(), source })?;
    Engine::load_checked(&bytes, engine).map_err(|source| StartError::Model { path: path.to_owned(), source })
}

/// The mission with its city, whose path is relative to the mission file.
pub fn mission(path: &Path) -> Result<Mission, StartError> {
    let text = fs::read_to_string(path).map_err(|source| StartError::Read {
        what: "mission",
        path: path.to_owned(),
        source,
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let city = |name: &str| {
        fs::read_to_string(folder.join(name))
            .map_err(|error| format!("cannot be read: {error}: put the city beside the mission"))
    };
    mission_file::read(&text, city).map_err(|source| StartError::Mission { path: path.to_owned(), source })
}
