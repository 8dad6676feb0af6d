//! The interface between a way of learning and the loop that runs it.

use crate::judge::evaluation::DeciderError;
use crate::judge::validation::Tables;
use crate::keep::checkpoint::CheckpointError;
use crate::keep::snapshot::Snapshot;
use crate::settings::Settings;
use gleaner_world::ScenarioError;
use serde::Serialize;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A training run: everything that the next update depends on. A run that is opened again continues from its last
/// checkpoint.
pub trait Trainer {
    /// The losses of an update: named numbers for the curve, a short text for the console.
    type Losses: Serialize + Display;
    /// How often it reports and saves by default.
    const PACE: Pace;

    /// The settings of the run.
    fn settings(&self) -> &Settings;

    /// Updates done.
    fn update(&self) -> u64;

    /// Environment steps done.
    fn steps(&self) -> u64;

    /// Whether all updates are done.
    fn is_done(&self) -> bool {
        self.update() >= self.settings().updates
    }

    /// Collects experience and makes one update of the networks.
    ///
    /// # Errors
    /// No mission could be drawn.
    fn advance(&mut self) -> Result<Self::Losses, TrainError>;

    /// Evaluates the averaged policy on the validation realizations and replaces `best` if it is better.
    ///
    /// # Errors
    /// The network's output is not a number: the run diverged.
    fn validate(&mut self, best: &mut Option<Snapshot>) -> Result<Tables, TrainError>;

    /// Writes the checkpoint, and the averaged policy to [`crate::keep::snapshot::LAST`].
    ///
    /// # Errors
    /// The file system; the last good checkpoint is then still there.
    fn save(&mut self, folder: &Path) -> Result<(), CheckpointError>;
}

/// Updates between two events, chosen so that each event comes every few minutes on one core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace {
    /// Points of the losses in the learning curve.
    pub losses: u64,
    /// Checkpoints.
    pub checkpoint: u64,
    /// Validations.
    pub validation: u64,
}

impl Pace {
    /// For small updates, tens per second.
    pub const FAST: Pace = Pace { losses: 250, checkpoint: 2_500, validation: 5_000 };
    /// For large updates, seconds each.
    pub const SLOW: Pace = Pace { losses: 5, checkpoint: 25, validation: 100 };
}

/// Why a run cannot start or continue.
#[derive(Debug, Error)]
pub enum TrainError {
    /// The checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The missions.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The network.
    #[error(transparent)]
    Decider(#[from] DeciderError),
    /// The folder has a run with other settings.
    #[error(
        "{}: has a run with other settings ({difference}); give another --out folder, or the settings of that run",
        path.display()
    )]
    OtherSettings {
        /// The checkpoint.
        path: PathBuf,
        /// The first setting that differs.
        difference: String,
    },
    /// The folder has a run of another system.
    #[error("{}: has a run of {found}; give another --out folder, or --system {found}", path.display())]
    OtherSystem {
        /// The checkpoint.
        path: PathBuf,
        /// The system of that run.
        found: String,
    },
}
