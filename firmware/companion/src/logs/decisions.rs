//! The decision log: `decisions.jsonl`, one JSON object a line.

use super::LogError;
use super::rotation::{Limits, RotatingFile};
use super::writer::{LogWriter, NewsSender};
use gleaner_pilot::{Decision, LoggedDecision, LoggedLookAhead};
use gleaner_units::{Duration, Ned};
use std::path::Path;

/// The open log.
pub struct DecisionLog {
    run_s: u64,
    writer: LogWriter,
}

impl DecisionLog {
    /// Opens `decisions.jsonl` in `folder`, which is made if it is not there; new lines follow old ones. `run_s` is the
    /// start of the run, seconds since 1970.
    ///
    /// # Errors
    /// The folder cannot be made, or the file cannot be opened.
    pub fn open(
        folder: &Path,
        run_s: u64,
        limits: Limits,
        news: NewsSender,
    ) -> Result<DecisionLog, LogError> {
        let file = RotatingFile::open(folder, "decisions", "jsonl", limits, false)
            .map_err(|source| LogError { path: folder.join("decisions.jsonl"), source })?;
        Ok(DecisionLog {
            run_s,
            writer: LogWriter::start("decision log", file, b"\n", std::time::Duration::ZERO, news),
        })
    }

    /// Hands one decision to the writer. Never waits.
    pub fn write(
        &mut self,
        decision: &Decision,
        inference_time: Option<Duration>,
        position: Option<Ned>,
        lookahead: Option<LoggedLookAhead>,
    ) {
        let logged = LoggedDecision {
            position_ned_m: position.map(|at| [at.north_m, at.east_m, at.down_m]),
            lookahead,
            ..LoggedDecision::new(self.run_s, decision, inference_time)
        };
        // Serialising cannot fail: every key is a string.
        let mut line = serde_json::to_vec(&logged).unwrap_or_default();
        line.push(b'\n');
        self.writer.write(line);
    }

    /// Waits until everything is written.
    pub fn close(self) {
        self.writer.close();
    }
}
