//! Why the program cannot run: what, where, what to do. Every error ends it with exit code 2.

use crate::config::ConfigError;
use crate::routing::SigningError;
use crate::seal::SealError;
use crate::text::TextFault;
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
    /// A file is not text.
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
    /// Mission and settings are good each, but not together.
    #[error("{}: {source}: correct it", .path.display())]
    Refused {
        /// The mission.
        path: PathBuf,
        /// What.
        source: OnboardError,
    },
    /// The model may not fly.
    #[error("model {}: {source}", .path.display())]
    Model {
        /// Where.
        path: PathBuf,
        /// What.
        source: ModelError,
    },
    /// The model cannot be converted for the native engine.
    #[error("model {}: {source}", .path.display())]
    Convert {
        /// Where.
        path: PathBuf,
        /// Why.
        source: ConvertError,
    },
    /// The model cannot be sealed.
    #[error("model {}: {source}", .path.display())]
    Seal {
        /// Where.
        path: PathBuf,
        /// Why.
        source: SealError,
    },
    /// A result cannot be written.
    #[error("{}: cannot be written: {source}: give another path with --out, or correct its permissions", .path.display())]
    Write {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A log cannot be written.
    #[error("log {}: {source}: give another folder with --log, or correct its permissions", .path.display())]
    Log {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A port cannot sign.
    #[error("signing {}: {source}", .path.display())]
    Signing {
        /// The key file, or the file of the timestamps.
        path: PathBuf,
        /// What.
        source: SigningError,
    },
    /// The state folder cannot be used.
    #[error("state {}: {source}: give another folder with --state, or correct its permissions", .path.display())]
    State {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The log holds no decision.
    #[error("decision log {}: holds no decision: give a decisions.jsonl of `gleaner run` or `gleaner-sitl`", .path.display())]
    NoDecisions {
        /// Where.
        path: PathBuf,
    },
    /// A port cannot be opened.
    #[error("{role} port {source}")]
    Port {
        /// Its purpose.
        role: &'static str,
        /// What.
        source: PortError,
    },
    /// The page cannot be served.
    #[error(transparent)]
    Page(#[from] gleaner_dashboard::ServerError),
    /// The page would command as an operator that is not allowed.
    #[error(
        "the page commands as {operator}, which `operators` leaves out: add \"{operator}\" there, or remove `http`"
    )]
    PageOperator {
        /// `SYSTEM/COMPONENT`.
        operator: String,
    },
    /// Interrupts cannot be caught.
    #[error("cannot catch interrupts: {0}: start the program where signals are not blocked")]
    Signals(io::Error),
}
