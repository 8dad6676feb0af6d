//! `parameters.toml`: the parameters that a ground station has set, kept for the next run.

use super::StateError;
use super::atomic::Replacer;
use gleaner_link::{PARAMETERS, ParameterId, Parameters};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const HEADER: &str = "\
# Parameters set from a ground station. Written by `gleaner run`; they override the configuration.
# `gleaner run --reset-parameters` removes this file.
";
/// A knob or a slider changes a parameter many times a second; the disk gets the value at which it rests.
const REST: Duration = Duration::from_secs(1);

/// The file and what it holds.
pub struct ParameterFile {
    path: PathBuf,
    /// The values of the configuration: only what differs from them is kept.
    configured: Parameters,
    /// The values as last handed to the disk.
    saved: Values,
    /// The values as last seen, and since when.
    seen: (Values, Option<Instant>),
    replacer: Option<Replacer>,
}

type Values = BTreeMap<&'static str, f32>;

impl ParameterFile {
    /// Reads the file in `folder` over the parameters of the configuration. Returns the file, the parameters to start
    /// with, and a line for each kept value or fault.
    ///
    /// # Errors
    /// The folder cannot be made, or the file cannot be read.
    pub fn open(
        folder: &Path,
        configured: &Parameters,
    ) -> Result<(ParameterFile, Parameters, Vec<String>), StateError> {
        let path = folder.join("parameters.toml");
        let fail = |source| StateError { path: path.clone(), source };
        fs::create_dir_all(folder).map_err(fail)?;
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(fail(error)),
        };
        let (parameters, lines) = apply(&text, configured);
        let saved = differences(configured, &parameters);
        let file = ParameterFile {
            configured: configured.clone(),
            seen: (saved.clone(), None),
            saved,
            replacer: None,
            path,
        };
        Ok((file, parameters, lines))
    }

    /// Removes the file in `folder`, if it is there.
    ///
    /// # Errors
    /// It is there and cannot be removed.
    pub fn reset(folder: &Path) -> Result<(), StateError> {
        let path = folder.join("parameters.toml");
        match fs::remove_file(&path) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => Err(StateError { path, source }),
            _ => Ok(()),
        }
    }

    /// Saves the parameters when they have changed and rest. Never waits. Returns the fault of an earlier save.
    pub fn poll(&mut self, now: Instant, parameters: &Parameters) -> Option<io::Error> {
        let values = differences(&self.configured, parameters);
        if values != self.seen.0 {
            self.seen = (values, Some(now));
        } else if self.seen.1.is_some_and(|since| now.saturating_duration_since(since) >= REST) {
            self.seen.1 = None;
            self.save();
        }
        self.replacer.as_ref().and_then(Replacer::error)
    }

    fn save(&mut self) {
        if self.seen.0 == self.saved {
            return;
        }
        self.saved = self.seen.0.clone();
        let path = &self.path;
        let replacer = self.replacer.get_or_insert_with(|| Replacer::start(path.clone()));
        // Serialising cannot fail: every key is a string and every value a number.
        replacer.put(format!("{HEADER}{}", toml::to_string(&self.saved).unwrap_or_default()));
    }

    /// Writes what has not been written yet, and waits for it.
    pub fn close(mut self) {
        self.save();
        if let Some(replacer) = self.replacer {
            replacer.close();
        }
    }
}

/// What a ground station may keep: everything but the request to engage, which holds for one flight.
fn differences(configured: &Parameters, parameters: &Parameters) -> Values {
    let kept = PARAMETERS.iter().filter(|spec| spec.id != ParameterId::Enable);
    kept.filter(|spec| parameters.value(spec.id) != configured.value(spec.id))
        .map(|spec| (spec.name, parameters.value(spec.id)))
        .collect()
}

/// A damaged file or value costs itself only: the configuration's values are there, too.
fn apply(text: &str, configured: &Parameters) -> (Parameters, Vec<String>) {
    let mut parameters = configured.clone();
    let mut lines = Vec::new();
    let values: BTreeMap<String, f32> = toml::from_str(text).unwrap_or_else(|error| {
        lines.push(format!("kept parameters: {}: using the configuration", error.message()));
        BTreeMap::new()
    });
    for (name, value) in values {
        let before = ParameterId::from_name(&name).map(|id| configured.value(id));
        if name == "GLN_ENABLE" {
            lines.push("kept parameters: GLN_ENABLE is never kept: ignored".to_owned());
        } else if let Err(error) = parameters.set(&name, value) {
            lines.push(format!("kept parameters: {name} = {value}: {error}: ignored"));
        } else if let Some(before) = before.filter(|&before| before != value) {
            lines.push(format!("{name} = {value}, set from the ground; the configuration has {before}"));
        }
    }
    (parameters, lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(folder: &Path) -> (ParameterFile, Parameters, Vec<String>) {
        ParameterFile::open(folder, &Parameters::default()).unwrap()
    }

    #[test]
    fn a_value_set_from_the_ground_outlives_the_run() {
        let folder = tempfile::tempdir().unwrap();
        let (mut file, mut parameters, lines) = open(folder.path());
        assert!(lines.is_empty());
        let start = Instant::now();
        assert!(file.poll(start, &parameters).is_none());
        parameters.set("GLN_ALT", 75.5).unwrap();
        parameters.set("GLN_ENABLE", 1.0).unwrap();
        file.poll(start, &parameters);
        assert!(!folder.path().join("parameters.toml").exists(), "it waits until the value rests");
        file.poll(start + REST, &parameters);
        file.close();

        let (file, parameters, lines) = open(folder.path());
        assert_eq!(parameters.altitude().0, 75.5);
        assert_eq!(parameters.value(ParameterId::Enable), 0.0, "a restart never engages");
        assert_eq!(lines.len(), 1);
        assert!(lines[0].starts_with("GLN_ALT = 75.5, set from the ground"), "{lines:?}");
        file.close();
        ParameterFile::reset(folder.path()).unwrap();
        ParameterFile::reset(folder.path()).unwrap();
        assert_eq!(open(folder.path()).1, Parameters::default());
    }

    #[test]
    fn a_change_just_before_the_end_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let (mut file, mut parameters, _) = open(folder.path());
        parameters.set("GLN_W_DATA", 0.1).unwrap();
        file.poll(Instant::now(), &parameters);
        file.close();
        assert_eq!(open(folder.path()).1.data_weight(), 0.1);
    }

    #[test]
    fn damaged_values_are_reported_and_ignored() {
        for (text, part) in [
            ("GLN_ALT = ", "using the configuration"),
            ("GLN_ALT = 1e9", "GLN_ALT = 1000000000: "),
            ("GLN_NONE = 1.0", "GLN_NONE = 1: "),
            ("GLN_ENABLE = 1.0", "never kept"),
        ] {
            let (parameters, lines) = apply(text, &Parameters::default());
            assert_eq!(parameters, Parameters::default());
            assert!(lines.len() == 1 && lines[0].contains(part), "{text}: {lines:?}");
        }
    }
}
