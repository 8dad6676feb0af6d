//! What a run leaves on disk: decisions and telemetry, in files that rotate and never fill the disk.

mod decisions;
mod rotation;
mod telemetry;
mod writer;

pub use decisions::DecisionLog;
pub use rotation::Limits;
pub use telemetry::TelemetryLog;
pub use writer::LogNews;

use std::io;
use std::path::PathBuf;

/// A log cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("log {}: {source}: give another folder with --log, or correct its permissions", .path.display())]
pub struct LogError {
    /// Which file.
    path: PathBuf,
    /// Why.
    source: io::Error,
}
