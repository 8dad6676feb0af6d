//! Why the program cannot run: what, where, what to do. All end it with exit code 2.

use crate::config::ConfigError;
use gleaner_pilot::OnboardError;
use gleaner_pilot::mission_file::MissionFileError;
use gleaner_policy::onnx::{ConvertError, ModelError};
use gleaner_ports::PortError;
use std::io;
use std::path::PathBuf;

/// Why the program cannot run.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A file cannot be read.
    #[error("{what} {}: cannot be read: {source}: correct the path, or the file's permissions", .path.display())]
    Read {
        /// Which kind of file.
        what: &'static str,
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The mission file is wrong.
    #[error("mission {}: {source}", .path.display())]
    Mission {
        /// Where.
        path: PathBuf,
        /// What.
        source: MissionFileError,
    },
    /// Mission and settings, each good for itself, make no pilot together.
    #[error("{}: {source}: correct it", .path.display())]
    Refused {
        /// The mission.
        path: PathBuf,
        /// What.
        source: OnboardError,
    },
    /// The model is not fit to fly.
    #[error("model {}: {source}", .path.display())]
    Model {
        /// Where.
        path: PathBuf,
        /// What.
        source: ModelError,
    },
    /// The model has no form for the native engine.
    #[error("model {}: {source}", .path.display())]
    Convert {
        /// Where.
        path: PathBuf,
        /// Why.
        source: ConvertError,
    },
    /// A result cannot be written.
    #[error("{}: cannot be written: {source}: give another path with --out, or its permissions", .path.display())]
    Write {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The decision log cannot be written.
    #[error("decision log {}: {source}: give another folder with --log, or its permissions", .path.display())]
    Log {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// There is nothing to decide again.
    #[error("decision log {}: holds no decision: give the decisions.jsonl that `gleaner run --log` wrote", .path.display())]
    NoDecisions {
        /// Where.
        path: PathBuf,
    },
    /// A port cannot be opened.
    #[error("{role} port {source}")]
    Port {
        /// What it is for.
        role: &'static str,
        /// What.
        source: PortError,
    },
    /// Interrupts cannot be caught.
    #[error("cannot catch interrupts: {0}: start the program outside of what blocks its signals")]
    Signals(io::Error),
}
