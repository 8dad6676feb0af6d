//! Files to checked values.

use crate::text::{self, TextFault};
use gleaner_pilot::mission_file::MissionFileError;
use gleaner_pilot::{Mission, mission_file, mission_image};
use gleaner_policy::onnx::ModelError;
use gleaner_policy::{Engine, EngineKind};
use gleaner_units::Metres;
use gleaner_units::city_file::read_city;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Why a file is not used.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// It cannot be read.
    #[error("{what} {}: cannot be read: {source}: correct the path, or the file's permissions", .path.display())]
    Read {
        /// Which kind of file.
        what: &'static str,
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is not text.
    #[error("{what} {}: {source}", .path.display())]
    Text {
        /// Which kind of file.
        what: &'static str,
        /// Where.
        path: PathBuf,
        /// What.
        source: TextFault,
    },
    /// The mission file is wrong.
    #[error("mission {}: {source}", .path.display())]
    Mission {
        /// Where.
        path: PathBuf,
        /// What.
        source: MissionFileError,
    },
    /// The model may not fly.
    #[error("model {}: {source}", .path.display())]
    Model {
        /// Where.
        path: PathBuf,
        /// What.
        source: ModelError,
    },
}

/// The model that is built into the program.
pub const SHIPPED: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/gleaner.onnx"));

/// What messages call the built-in model.
const SHIPPED_NAME: &str = "built-in";

/// The model file, or the built-in model, after it reproduced its golden pairs. Without a choice of engine the native one
/// runs it, or tract where the graph is not the one that the native engine knows.
///
/// # Errors
/// The file cannot be read, or is no model that may fly.
pub fn model(path: Option<&Path>, engine: Option<EngineKind>) -> Result<Engine, LoadError> {
    let bytes = model_bytes(path)?;
    let load = |kind| Engine::load_checked(&bytes, kind);
    let loaded = match engine {
        Some(kind) => load(kind),
        None if !EngineKind::Tract.is_built() => load(EngineKind::Native),
        None => load(EngineKind::Native).or_else(|_| load(EngineKind::Tract)),
    };
    loaded.map_err(|source| LoadError::Model { path: model_name(path), source })
}

/// The bytes of the model file, or of the built-in model.
///
/// # Errors
/// The file cannot be read.
pub fn model_bytes(path: Option<&Path>) -> Result<Vec<u8>, LoadError> {
    let Some(path) = path else { return Ok(SHIPPED.to_vec()) };
    fs::read(path).map_err(|source| LoadError::Read { what: "model", path: path.to_owned(), source })
}

/// What messages call the model.
pub fn model_name(path: Option<&Path>) -> PathBuf {
    path.map_or_else(|| PathBuf::from(SHIPPED_NAME), Path::to_owned)
}

/// The mission that a run left beside its logs; `None` where there is none.
pub fn flown_mission(path: &Path) -> Option<Mission> {
    mission_image::decode(&fs::read(path).ok()?).ok()
}

/// A mission, and what was noticed while its city was read.
pub struct Loaded {
    /// The mission.
    pub mission: Mission,
    /// Building heights with decimals, which were rounded up to whole metres.
    pub rounded: usize,
}

/// The mission with its city, whose path is relative to the mission file.
///
/// # Errors
/// A file cannot be read, or the mission cannot be flown.
pub fn mission(path: &Path) -> Result<Loaded, LoadError> {
    let bytes = fs::read(path).map_err(|source| LoadError::Read {
        what: "mission",
        path: path.to_owned(),
        source,
    })?;
    let text = text::decode(bytes).map_err(|source| LoadError::Text {
        what: "mission",
        path: path.to_owned(),
        source,
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut rounded = 0;
    let city = |name: &str| {
        let bytes = fs::read(folder.join(name))
            .map_err(|error| format!("cannot be read: {error}: put the city beside the mission"))?;
        let city = text::decode(bytes).map_err(|fault| fault.to_string())?;
        // Faults are reported by the mission's reader.
        rounded += read_city(city.as_bytes(), Metres(1.0)).map_or(0, |city| city.rounded);
        Ok(city)
    };
    match mission_file::read(&text, city) {
        Ok(mission) => Ok(Loaded { mission, rounded }),
        Err(source) => Err(LoadError::Mission { path: path.to_owned(), source }),
    }
}
