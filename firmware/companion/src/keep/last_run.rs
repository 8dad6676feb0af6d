//! `last_run.toml`: what the run was doing, written at every change of state and after every decision. The next run reads
//! how it ended and how much of the mission's battery it used.

use super::atomic::{Replacer, replace};
use gleaner_link::Severity;
use gleaner_pilot::State;
use gleaner_units::BatteryUnits;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// The file's content.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Note {
    /// Start of the run, seconds since 1970.
    run_s: u64,
    /// When this was written, seconds since 1970.
    at_s: u64,
    /// The pilot's state.
    state: String,
    /// Whether the run ended as asked.
    ended: bool,
    /// Battery units that the mission used.
    #[serde(default)]
    spent_units: f32,
    /// The panic that ended it.
    #[serde(skip_serializing_if = "Option::is_none")]
    panic: Option<String>,
}

/// How the last run ended.
#[derive(Clone, Debug, PartialEq)]
pub struct LastRun {
    state: String,
    panic: Option<String>,
    ended: bool,
    spent: BatteryUnits,
}

impl LastRun {
    /// Whether it ended as asked.
    pub fn ended(&self) -> bool {
        self.ended
    }

    /// Battery units that its mission used. The next run continues with the rest while the motors stay armed.
    pub fn spent(&self) -> BatteryUnits {
        self.spent
    }

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
    written: Option<(State, BatteryUnits)>,
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

    /// Notes the state and the battery used when they have changed. Never waits. Returns the fault of an earlier write.
    pub fn note(&mut self, state: State, spent: BatteryUnits, at_s: u64) -> Option<std::io::Error> {
        if self.written != Some((state, spent)) {
            self.written = Some((state, spent));
            self.replacer.put(text(&self.at(state, spent, at_s)));
        }
        self.replacer.error()
    }

    fn at(&self, state: State, spent: BatteryUnits, at_s: u64) -> Note {
        let state = state.name().to_owned();
        Note { run_s: self.run_s, at_s, state, ended: false, spent_units: spent.0, panic: None }
    }

    /// The run ends as asked.
    pub fn close(self, state: State, spent: BatteryUnits, at_s: u64) {
        let note = Note { ended: true, ..self.at(state, spent, at_s) };
        self.replacer.close();
        if let Err(error) = replace(&self.path, text(&note).as_bytes()) {
            tracing::warn!("{}: {error}: the next run will report an interrupted run", self.path.display());
        }
    }
}

fn read(path: &Path) -> Option<LastRun> {
    let note: Note = toml::from_str(&fs::read_to_string(path).ok()?).ok()?;
    let spent = BatteryUnits(note.spent_units);
    Some(LastRun { state: note.state, panic: note.panic, ended: note.ended, spent })
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

    fn ended(folder: &Path, state: State, ended: bool) -> LastRun {
        let path = folder.join("last_run.toml");
        let note =
            Note { run_s: 1, at_s: 2, state: state.name().into(), ended, spent_units: 7.5, panic: None };
        fs::write(&path, text(&note)).unwrap();
        read(&path).unwrap()
    }

    #[test]
    fn a_run_that_was_cut_off_in_flight_is_critical() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(read(&folder.path().join("last_run.toml")), None);
        assert!(ended(folder.path(), State::Engaged, true).ended());
        let last = ended(folder.path(), State::Engaged, false);
        assert_eq!((last.ended(), last.spent()), (false, BatteryUnits(7.5)));
        assert_eq!(
            (last.severity(), last.to_string().as_str()),
            (Severity::Critical, "last run was cut off while engaged")
        );
        let last = ended(folder.path(), State::Idle, false);
        assert_eq!(last.severity(), Severity::Warning);
        for state in State::ALL {
            let last = LastRun { panic: Some(String::new()), ..ended(folder.path(), state, false) };
            assert!(format!("gleaner: {last}").len() <= 50);
        }
    }

    #[test]
    fn a_note_of_an_older_program_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("last_run.toml");
        fs::write(&path, "run_s = 1\nat_s = 2\nstate = \"idle\"\nended = true\n").unwrap();
        assert_eq!(read(&path).unwrap().spent(), BatteryUnits(0.0));
    }

    #[test]
    fn the_file_holds_the_newest_state_and_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("last_run.toml");
        let replacer = Replacer::start(path.clone());
        let mut file = LastRunFile { path: path.clone(), run_s: 5, written: None, replacer };
        file.note(State::Idle, BatteryUnits(0.0), 6);
        file.note(State::Engaged, BatteryUnits(0.0), 7);
        file.note(State::Engaged, BatteryUnits(1.5), 7);
        file.replacer.close();
        let last = read(&path).unwrap();
        assert_eq!((last.state.as_str(), last.spent()), ("engaged", BatteryUnits(1.5)));
        let replacer = Replacer::start(path.clone());
        let file = LastRunFile { path: path.clone(), run_s: 5, written: None, replacer };
        file.close(State::Engaged, BatteryUnits(2.0), 8);
        assert!(read(&path).unwrap().ended());
    }
}
