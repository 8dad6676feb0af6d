//! Why the program cannot run: what, where, what to do. Every error ends it with exit code 2.

use crate::config::ConfigError;
#[cfg(feature = "tract")]
use crate::contract::SealError;
use crate::keep::StateError;
use crate::load::LoadError;
use crate::logs::LogError;
use crate::routing::SigningError;
use gleaner_pilot::OnboardError;
use gleaner_policy::onnx::ConvertError;
use gleaner_ports::PortError;
use std::io;
use std::path::PathBuf;

/// Why the program cannot run.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Model, mission or another file.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A log cannot be written.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The state folder cannot be used.
    #[error(transparent)]
    State(#[from] StateError),
    /// Mission and settings are good each, but not together.
    #[error("{}: {source}: correct it", .path.display())]
    Refused {
        /// The mission.
        path: PathBuf,
        /// What.
        source: OnboardError,
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
    #[cfg(feature = "tract")]
    #[error("model {}: {source}", .path.display())]
    Seal {
        /// Where.
        path: PathBuf,
        /// Why.
        source: SealError,
    },
    /// This program cannot run the graph of a model of one's own.
    #[cfg(not(feature = "tract"))]
    #[error(
        "sealing needs the engine tract, which this program has not: use the program of the Debian package"
    )]
    NoTract,
    /// A result cannot be written.
    #[error("{}: cannot be written: {source}: give another path with --out, or correct its permissions", .path.display())]
    Write {
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
    /// The log holds no decision.
    #[error("decision log {}: holds no decision: give a decisions.jsonl of `gleaner run` or `gleaner-sitl`", .path.display())]
    NoDecisions {
        /// Where.
        path: PathBuf,
    },
    /// The flight's folder has no mission.
    #[error("{}: is no mission of a flight: give the mission file with --mission", .path.display())]
    NoMission {
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
