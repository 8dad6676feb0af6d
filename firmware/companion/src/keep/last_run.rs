//! `last_run.toml`: what the run was doing, written at every change of state. The next run reads how it ended.

use super::atomic::{Replacer, replace};
use gleaner_link::Severity;
use gleaner_pilot::State;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// The file's content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Note {
    /// Start of the run, seconds since 1970.
    run_s: u64,
    /// When this was written, seconds since 1970.
    at_s: u64,
    /// The pilot's state.
    state: String,
    /// Whether the run ended as asked.
    ended: bool,
    /// The panic that ended it.
    #[serde(skip_serializing_if = "Option::is_none")]
    panic: Option<String>,
}

/// How the last run ended, if it did not end as asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LastRun {
    state: String,
    panic: Option<String>,
}

impl LastRun {
    /// A run that ended while it had the aircraft is critical.
    pub fn severity(&self) -> Severity {
        let flying =
            [State::Waiting, State::Engaged, State::Homing].iter().any(|state| state.name() == self.state);
        if flying { Severity::Critical } else { Severity::Warning }
    }

    /// The panic that ended it, for the console.
    pub fn panic(&self) -> Option<&str> {
        self.panic.as_deref()
    }
}

/// Fits one `STATUSTEXT` of 50 characters.
impl fmt::Display for LastRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = if self.panic.is_some() { "panicked" } else { "was cut off" };
        write!(f, "last run {how} while {}", self.state)
    }
}

/// The open file.
pub struct LastRunFile {
    path: PathBuf,
    run_s: u64,
    written: Option<State>,
    replacer: Replacer,
}

impl LastRunFile {
    /// Reads how the last run ended and begins the note of this one.
    pub fn open(folder: &Path, run_s: u64) -> (LastRunFile, Option<LastRun>) {
        let path = folder.join("last_run.toml");
        let last = read(&path);
        note_panics(path.clone(), run_s);
        let replacer = Replacer::start(path.clone());
        (LastRunFile { path, run_s, written: None, replacer }, last)
    }

    /// Notes the state when it has changed. Never waits. Returns the fault of an earlier write.
    pub fn note(&mut self, state: State, at_s: u64) -> Option<std::io::Error> {
        if self.written != Some(state) {
            self.written = Some(state);
            self.replacer.put(text(&self.at(state, at_s)));
        }
        self.replacer.error()
    }

    fn at(&self, state: State, at_s: u64) -> Note {
        Note { run_s: self.run_s, at_s, state: state.name().to_owned(), ended: false, panic: None }
    }

    /// The run ends as asked.
    pub fn close(self, state: State, at_s: u64) {
        let note = Note { ended: true, ..self.at(state, at_s) };
        self.replacer.close();
        if let Err(error) = replace(&self.path, text(&note).as_bytes()) {
            tracing::warn!("{}: {error}: the next run will report an interrupted run", self.path.display());
        }
    }
}

fn read(path: &Path) -> Option<LastRun> {
    let note: Note = toml::from_str(&fs::read_to_string(path).ok()?).ok()?;
    (!note.ended).then_some(LastRun { state: note.state, panic: note.panic })
}

fn text(note: &Note) -> String {
    // Serialising cannot fail: every key is a string.
    toml::to_string(note).unwrap_or_default()
}

/// Adds the cause to the note when the program panics.
fn note_panics(path: PathBuf, run_s: u64) {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        before(panic);
        let note = fs::read_to_string(&path).ok().and_then(|text| toml::from_str::<Note>(&text).ok());
        if let Some(note) = note.filter(|note| note.run_s == run_s) {
            let cause = panic.to_string().replace('\n', " ");
            // It is on stderr already if it cannot be written.
            let _ = replace(&path, text(&Note { panic: Some(cause), ..note }).as_bytes());
        }
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(folder: &Path, state: State, ended: bool) -> Option<LastRun> {
        let path = folder.join("last_run.toml");
        let note = Note { run_s: 1, at_s: 2, state: state.name().into(), ended, panic: None };
        fs::write(&path, text(&note)).unwrap();
        read(&path)
    }

    #[test]
    fn a_run_that_was_cut_off_in_flight_is_critical() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(read(&folder.path().join("last_run.toml")), None);
        assert_eq!(ended(folder.path(), State::Engaged, true), None);
        let last = ended(folder.path(), State::Engaged, false).unwrap();
        assert_eq!(
            (last.severity(), last.to_string().as_str()),
            (Severity::Critical, "last run was cut off while engaged")
        );
        let last = ended(folder.path(), State::Idle, false).unwrap();
        assert_eq!(last.severity(), Severity::Warning);
        for state in State::ALL {
            let last = LastRun { state: state.name().into(), panic: Some(String::new()) };
            assert!(format!("gleaner: {last}").len() <= 50);
        }
    }

    #[test]
    fn the_file_holds_the_newest_state_and_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("last_run.toml");
        let replacer = Replacer::start(path.clone());
        let mut file = LastRunFile { path: path.clone(), run_s: 5, written: None, replacer };
        file.note(State::Idle, 6);
        file.note(State::Engaged, 7);
        file.replacer.close();
        assert_eq!(read(&path).unwrap().state, "engaged");
        let replacer = Replacer::start(path.clone());
        LastRunFile { path: path.clone(), run_s: 5, written: None, replacer }.close(State::Engaged, 8);
        assert_eq!(read(&path), None);
    }
}
