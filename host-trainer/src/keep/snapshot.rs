//! Snapshots: the parameters of a policy, with the command and settings that trained them.

use crate::keep::checkpoint::{self, CheckpointError};
use crate::settings::{Settings, as_json};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// File name of the best parameters inside the output folder.
pub const SNAPSHOT: &str = "learned.checkpoint";
/// Folder inside the output folder with the current parameters. The output folder itself has the best ones.
pub const LAST: &str = "last";

/// The parameters of a policy and where they come from: the input of `evaluate` and `export`.
///
/// The file starts with the name of the system.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Snapshot {
    /// Name of the system.
    #[serde(skip)]
    pub system: String,
    /// The command that trained it, without its settings.
    pub method: String,
    /// Its settings.
    #[serde(with = "as_json")]
    pub settings: Settings,
    /// Parameters of the network that selects actions: the actor, or the values of DDQN.
    pub actor: Vec<f32>,
    /// Update that they are from.
    pub update: u64,
    /// Environment steps until then.
    pub steps: u64,
    /// Score on the validation realizations, by which the best parameters are chosen.
    pub score: f64,
}

impl Snapshot {
    /// Reads the snapshot in `folder`; `None` if there is none yet.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn load(folder: &Path) -> Result<Option<Snapshot>, CheckpointError> {
        let path = folder.join(SNAPSHOT);
        if !path.exists() {
            return Ok(None);
        }
        let named = checkpoint::load_named(&path)?;
        Ok(Some(Snapshot { system: named.name().to_owned(), ..named.value()? }))
    }

    /// Replaces `best` if its validation score is higher.
    pub fn offer(self, best: &mut Option<Snapshot>) {
        if best.as_ref().is_none_or(|best| self.score > best.score) {
            *best = Some(self);
        }
    }

    /// Writes it into `folder`, which is made if it does not exist.
    ///
    /// # Errors
    /// The file system; the old file is then still there.
    pub fn save(&self, folder: &Path) -> Result<(), CheckpointError> {
        std::fs::create_dir_all(folder)
            .map_err(|source| CheckpointError::Io { path: folder.to_path_buf(), source })?;
        checkpoint::save_named(&folder.join(SNAPSHOT), &self.system, self)
    }

    /// The command that trains the same again, with every setting that is not at its default.
    #[must_use]
    pub fn command_line(&self, out: &str) -> String {
        self.settings.command_line(&self.method, out)
    }
}
