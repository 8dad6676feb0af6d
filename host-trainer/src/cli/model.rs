//! Loading exported models.

use anyhow::{Context, Result};
use gleaner_policy::onnx::TractPolicy;
use std::fs;
use std::path::Path;

/// Loads a model and checks its golden pairs.
pub fn load(path: &Path) -> Result<TractPolicy> {
    let bytes = fs::read(path).with_context(|| path.display().to_string())?;
    TractPolicy::load_checked(&bytes).with_context(|| path.display().to_string())
}
