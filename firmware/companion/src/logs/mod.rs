//! What a run leaves on disk: decisions and telemetry, in files that rotate and never fill the disk.

mod decisions;
mod rotation;
mod telemetry;
mod writer;

pub use decisions::DecisionLog;
pub use rotation::Limits;
pub use telemetry::TelemetryLog;
pub use writer::LogNews;
