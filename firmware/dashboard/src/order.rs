//! What a viewer may ask for, and the way back to that viewer.

use serde::{Deserialize, Serialize};
use tokio::sync::oneshot;

/// A command of the page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// `MAV_CMD_USER_1`: the weight of data, 0 to 1.
    Preference(f32),
    /// `MAV_CMD_USER_2` and `MAV_CMD_USER_3`.
    Request(Request),
    /// Cause an incident of [`crate::Scene::incidents`]; only a simulation has any.
    Incident(String),
}

/// What an operator can request of the pilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Request {
    /// Command nothing.
    Off,
    /// Fly the mission.
    Engage,
    /// Decide and log, command nothing.
    Shadow,
    /// Fly to the terminal and land.
    Return,
}

/// A command that waits for its answer.
#[derive(Debug)]
pub struct Order {
    /// The request.
    pub command: Command,
    answer: oneshot::Sender<String>,
}

impl Order {
    pub(crate) fn new(command: Command) -> (Order, oneshot::Receiver<String>) {
        let (answer, answered) = oneshot::channel();
        (Order { command, answer }, answered)
    }

    /// Shows this line to the viewer who asked.
    pub fn answer(self, words: impl Into<String>) {
        // A viewer who has left needs no answer.
        let _ = self.answer.send(words.into());
    }
}
