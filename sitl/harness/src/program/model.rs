//! Loading the model.

use super::ProgramError;
use super::results::PolicyInfo;
use gleaner_policy::{Engine, EngineKind};
use std::io::ErrorKind;
use std::path::Path;

/// The shipped model, part of the program: a copied binary flies.
const SHIPPED: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/gleaner.onnx"));

/// Loads the model and runs its self-test.
pub(super) fn load(path: Option<&Path>, engine: EngineKind) -> Result<Engine, ProgramError> {
    let Some(path) = path.map(Path::to_owned) else {
        let unfit = |source| ProgramError::Model { path: "built in".into(), source };
        return Engine::load_checked(SHIPPED, engine).map_err(unfit);
    };
    let bytes = std::fs::read(&path).map_err(|source| match source.kind() {
        ErrorKind::NotFound => ProgramError::ModelMissing(path.clone()),
        _ => ProgramError::ModelRead { path: path.clone(), source },
    })?;
    Engine::load_checked(&bytes, engine).map_err(|source| ProgramError::Model { path, source })
}

/// Name, version, the beginning of the hash, and engine.
pub(super) fn info(policy: &Engine) -> PolicyInfo {
    let hash: String = policy.sha256().chars().take(12).collect();
    PolicyInfo {
        model: format!("{} {} ({hash})", policy.name(), policy.version()),
        engine: policy.kind().name(),
    }
}
