//! What a run leaves on disk: decisions and telemetry, in files that rotate and never fill the disk.

mod decisions;
mod rotation;
mod telemetry;
mod writer;

pub use decisions::DecisionLog;
pub use rotation::Limits;
pub use telemetry::TelemetryLog;
pub use writer::LogNews;

use crate::keep::replace;
use gleaner_pilot::{Mission, mission_image};
use std::io;
use std::path::{Path, PathBuf};

/// The mission of the last run, in the log folder.
pub const MISSION: &str = "mission.bin";

/// Writes the mission beside the logs, so that `gleaner report` needs no other file.
///
/// # Errors
/// Those of the file system. The flight does not need the file.
pub fn keep_mission(folder: &Path, mission: &Mission) -> io::Result<()> {
    replace(&folder.join(MISSION), &mission_image::encode(mission))
}

/// A log cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("log {}: {source}: give another folder with --log, or correct its permissions", .path.display())]
pub struct LogError {
    /// Which file.
    path: PathBuf,
    /// Why.
    source: io::Error,
}
