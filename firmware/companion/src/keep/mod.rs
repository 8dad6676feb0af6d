//! What outlives a run, in the state folder: parameters set from the ground, and how the last run ended.

mod atomic;
mod last_run;
mod parameters;

pub use atomic::{Replacer, replace};
pub use last_run::{LastRun, LastRunFile};
pub use parameters::ParameterFile;

use std::io;
use std::path::PathBuf;

/// The state folder cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("state {}: {source}: give another folder with --state, or correct its permissions", .path.display())]
pub struct StateError {
    /// Which file.
    path: PathBuf,
    /// Why.
    source: io::Error,
}
