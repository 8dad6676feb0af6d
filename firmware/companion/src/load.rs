//! Files to checked values.

use crate::error::StartError;
use crate::text;
use gleaner_pilot::{Mission, mission_file};
use gleaner_policy::{Engine, EngineKind};
use std::fs;
use std::path::{Path, PathBuf};

/// The model that is built into the program.
pub const SHIPPED: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/gleaner.onnx"));

/// What messages call the built-in model.
const SHIPPED_NAME: &str = "built-in";

/// The model file, or the built-in model, after it reproduced its golden pairs. Without a choice of engine the native one
/// runs it, or tract where the graph is not the one that the native engine knows.
///
/// # Errors
/// The file cannot be read, or is no model that may fly.
pub fn model(path: Option<&Path>, engine: Option<EngineKind>) -> Result<Engine, StartError> {
    let bytes = model_bytes(path)?;
    let load = |kind| Engine::load_checked(&bytes, kind);
    let loaded = match engine {
        Some(kind) => load(kind),
        None => load(EngineKind::Native).or_else(|_| load(EngineKind::Tract)),
    };
    loaded.map_err(|source| StartError::Model { path: model_name(path), source })
}

/// The bytes of the model file, or of the built-in model.
///
/// # Errors
/// The file cannot be read.
pub fn model_bytes(path: Option<&Path>) -> Result<Vec<u8>, StartError> {
    let Some(path) = path else { return Ok(SHIPPED.to_vec()) };
    fs::read(path).map_err(|source| StartError::Read { what: "model", path: path.to_owned(), source })
}

/// What messages call the model.
pub fn model_name(path: Option<&Path>) -> PathBuf {
    path.map_or_else(|| PathBuf::from(SHIPPED_NAME), Path::to_owned)
}

/// The mission with its city, whose path is relative to the mission file.
///
/// # Errors
/// A file cannot be read, or the mission cannot be flown.
pub fn mission(path: &Path) -> Result<Mission, StartError> {
    let bytes = fs::read(path).map_err(|source| StartError::Read {
        what: "mission",
        path: path.to_owned(),
        source,
    })?;
    let text = text::decode(bytes).map_err(|source| StartError::Text {
        what: "mission",
        path: path.to_owned(),
        source,
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let city = |name: &str| {
        let bytes = fs::read(folder.join(name))
            .map_err(|error| format!("cannot be read: {error}: put the city beside the mission"))?;
        text::decode(bytes).map_err(|fault| fault.to_string())
    };
    mission_file::read(&text, city).map_err(|source| StartError::Mission { path: path.to_owned(), source })
}
