//! What all ways of learning have in common, for the loop that runs them.

use crate::judge::validation::Tables;
use crate::keep::checkpoint::CheckpointError;
use crate::keep::snapshot::Learned;
use crate::learn::run::TrainError;
use crate::learn::settings::Settings;
use serde::Serialize;
use std::fmt::Display;
use std::path::Path;

/// A run: everything that the next update depends on. Killed and opened again, it goes on from its last checkpoint.
pub trait Learning {
    /// What an update tells: by name for the curve, in a few words for people.
    type Losses: Serialize + Display;
    /// How often it tells and saves, unless it is told how often.
    const PACE: Pace;

    /// What it was asked for.
    fn settings(&self) -> &Settings;

    /// Updates done.
    fn update(&self) -> u64;

    /// Slots flown.
    fn steps(&self) -> u64;

    /// Whether the settings ask for no more updates.
    fn is_done(&self) -> bool {
        self.update() >= self.settings().updates
    }

    /// Flies, and makes one update of the networks.
    ///
    /// # Errors
    /// No mission could be drawn.
    fn advance(&mut self) -> Result<Self::Losses, TrainError>;

    /// Judges the running average of the deciding network on the validation realizations, and puts it into `best` if
    /// it is better.
    ///
    /// # Errors
    /// The network's answer is not a number: the run diverged.
    fn validate(&mut self, best: &mut Option<Learned>) -> Result<Tables, TrainError>;

    /// Writes everything that the next update depends on.
    ///
    /// # Errors
    /// The disk; the last good checkpoint is then still there.
    fn save(&mut self, folder: &Path) -> Result<(), CheckpointError>;
}

/// Updates between two of a kind, so that each comes every few minutes on one core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace {
    /// Points of the losses in the learning curve.
    pub losses: u64,
    /// Checkpoints: what a kill can cost.
    pub checkpoint: u64,
    /// Validations.
    pub validation: u64,
}

impl Pace {
    /// Of many small updates, tens in a second.
    pub const QUICK: Pace = Pace { losses: 250, checkpoint: 2_500, validation: 5_000 };
    /// Of few large ones, seconds each.
    pub const SLOW: Pace = Pace { losses: 5, checkpoint: 25, validation: 100 };
}
