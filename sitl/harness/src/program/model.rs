//! Finding and loading the model.

use super::ProgramError;
use super::results::Brain;
use gleaner_policy::{Engine, EngineKind};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The shipped model, relative to the folder that the programs are installed or built in.
const SHIPPED: &str = "models/gleaner.onnx";

/// Loads the model and lets it prove itself.
pub(super) fn load(path: Option<&Path>, engine: EngineKind) -> Result<Engine, ProgramError> {
    let path = path.map_or_else(shipped, Path::to_owned);
    let bytes = std::fs::read(&path).map_err(|source| match source.kind() {
        ErrorKind::NotFound => ProgramError::ModelMissing(path.clone()),
        _ => ProgramError::ModelRead { path: path.clone(), source },
    })?;
    Engine::load_checked(&bytes, engine).map_err(|source| ProgramError::Model { path, source })
}

/// Next to the program, else in the source tree that it was built from.
fn shipped() -> PathBuf {
    let beside = std::env::current_exe().ok().and_then(|program| Some(program.parent()?.join(SHIPPED)));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(SHIPPED);
    let source = source.canonicalize().unwrap_or(source);
    beside.filter(|path| path.exists()).unwrap_or(source)
}

/// How a model is called in summaries: its name, its version and the beginning of its hash.
pub(super) fn brain(policy: &Engine) -> Brain {
    let hash: String = policy.sha256().chars().take(12).collect();
    Brain { model: format!("{} {} ({hash})", policy.name(), policy.version()), engine: policy.kind().name() }
}
