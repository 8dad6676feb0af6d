//! The configuration: the file's values, overridden by flags, all checked.
//!
//! ```toml
//! model = "policy.onnx"                       # paths are relative to this file
//! engine = "tract"                            # optional: tract or native
//! mission = "mission.toml"
//! autopilot = "serial:/dev/ttyAMA0:921600"
//! radio = "serial:/dev/ttyUSB0:115200"        # optional: reports may also come by TUNNEL
//! log_dir = "log"                             # optional
//! component_id = 191                          # optional
//! system_id = 1                               # optional: where no single autopilot's can be adopted
//!
//! [parameters]                                # optional: initial values, as PARAM_SET would set them
//! GLN_W_DATA = 0.5
//! ```

use crate::args::Setup;
use gleaner_link::Parameters;
use gleaner_pilot::Settings;
use gleaner_policy::EngineKind;
use gleaner_ports::Endpoint;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};
use toml::Spanned;

/// Everything that a run needs to know.
pub struct Config {
    /// The model file.
    pub model: PathBuf,
    /// What runs the model.
    pub engine: EngineKind,
    /// The mission file.
    pub mission: PathBuf,
    /// Port to the autopilot.
    pub autopilot: Endpoint,
    /// Port to the radio.
    pub radio: Option<Endpoint>,
    /// Folder of the decision log.
    pub log_dir: Option<PathBuf>,
    /// Who we are on the link.
    pub settings: Settings,
    /// Initial values.
    pub parameters: Parameters,
}

/// What is wrong with the configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("config {}: cannot be read: {source}: correct the path after --config", .path.display())]
    Read {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A line of the file is wrong.
    #[error("config {}: line {line}: {what}", .path.display())]
    Line {
        /// Where.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// Which key, what is wrong, what to do.
        what: String,
    },
    /// Neither file nor flag says this.
    #[error(
        "no {key} is set: give --{key}, or write `{key} = \"{example}\"` into the file given with --config"
    )]
    Missing {
        /// The key, which is also the flag.
        key: &'static str,
        /// A value that would do.
        example: &'static str,
    },
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct File {
    model: Option<PathBuf>,
    engine: Option<Spanned<String>>,
    mission: Option<PathBuf>,
    autopilot: Option<Spanned<String>>,
    radio: Option<Spanned<String>>,
    log_dir: Option<PathBuf>,
    component_id: Option<Spanned<i64>>,
    system_id: Option<Spanned<i64>>,
    #[serde(default)]
    parameters: BTreeMap<String, Spanned<f64>>,
}

/// The values to use: flags first, then the file.
///
/// # Errors
/// The first fault, see [`ConfigError`].
pub fn resolve(setup: &Setup) -> Result<Config, ConfigError> {
    match &setup.config {
        Some(path) => {
            let text = fs::read_to_string(path)
                .map_err(|source| ConfigError::Read { path: path.clone(), source })?;
            merge(setup, &Source { path, text: &text })
        }
        None => merge(setup, &Source { path: Path::new(""), text: "" }),
    }
}

/// The parameters that the file at `path` sets, the others as they are by default; nothing else of it is checked.
///
/// # Errors
/// The file cannot be read, is no configuration, or holds a parameter out of its range.
pub fn parameters(path: &Path) -> Result<Parameters, ConfigError> {
    let text =
        fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
    let source = Source { path, text: &text };
    source.parameters(&source.parse()?.parameters)
}

/// The file that values came from, to say where a fault is and what paths are relative to.
struct Source<'s> {
    path: &'s Path,
    text: &'s str,
}

fn merge(setup: &Setup, source: &Source<'_>) -> Result<Config, ConfigError> {
    let file = source.parse()?;
    let folder = source.path.parent().unwrap_or(Path::new(""));
    let path = |flag: &Option<PathBuf>, key: &Option<PathBuf>| {
        flag.clone().or_else(|| key.as_ref().map(|path| folder.join(path)))
    };
    let missing = |key, example| ConfigError::Missing { key, example };
    // All of the file is checked, also what a flag overrides: a fault must not wait for another day.
    let autopilot = file.autopilot.as_ref().map(|text| source.endpoint("autopilot", text)).transpose()?;
    let engine = file.engine.as_ref().map(|name| source.engine(name)).transpose()?;
    let radio = file.radio.as_ref().map(|text| source.endpoint("radio", text)).transpose()?;
    Ok(Config {
        settings: source.settings(&file)?,
        parameters: source.parameters(&file.parameters)?,
        model: path(&setup.model, &file.model).ok_or(missing("model", "policy.onnx"))?,
        engine: setup.engine.or(engine).unwrap_or_default(),
        mission: path(&setup.mission, &file.mission).ok_or(missing("mission", "mission.toml"))?,
        autopilot: setup
            .autopilot
            .clone()
            .or(autopilot)
            .ok_or(missing("autopilot", "serial:/dev/ttyAMA0:921600"))?,
        radio: setup.radio.clone().or(radio),
        log_dir: path(&setup.log_dir, &file.log_dir),
    })
}

impl Source<'_> {
    fn parse(&self) -> Result<File, ConfigError> {
        toml::from_str(self.text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            self.fault(offset, error.message().replace('\n', " "))
        })
    }

    fn fault(&self, offset: usize, what: String) -> ConfigError {
        let line = 1 + self.text.bytes().take(offset).filter(|&byte| byte == b'\n').count();
        ConfigError::Line { path: self.path.to_owned(), line, what }
    }

    fn endpoint(&self, key: &str, text: &Spanned<String>) -> Result<Endpoint, ConfigError> {
        text.get_ref().parse().map_err(|error| self.fault(text.span().start, format!("{key}: {error}")))
    }

    fn engine(&self, name: &Spanned<String>) -> Result<EngineKind, ConfigError> {
        name.get_ref()
            .parse()
            .map_err(|error| self.fault(name.span().start, format!("engine = {:?}: {error}", name.get_ref())))
    }

    /// MAVLink guide, "Routing": 0 means everybody; 255 is what ground stations call themselves, and component 1
    /// is the autopilot.
    fn settings(&self, file: &File) -> Result<Settings, ConfigError> {
        let mut settings = Settings::default();
        if let Some(component_id) = &file.component_id {
            settings.component_id = self.id("component_id", component_id, 2..=254, "191 to 194 are usual")?;
        }
        if let Some(system_id) = &file.system_id {
            let id = self.id("system_id", system_id, 1..=254, "or leave it out to adopt the autopilot's")?;
            settings.system_id = Some(id);
        }
        Ok(settings)
    }

    fn id(
        &self,
        key: &str,
        value: &Spanned<i64>,
        allowed: std::ops::RangeInclusive<u8>,
        advice: &str,
    ) -> Result<u8, ConfigError> {
        u8::try_from(*value.get_ref()).ok().filter(|id| allowed.contains(id)).ok_or_else(|| {
            let (low, high) = (allowed.start(), allowed.end());
            let what =
                format!("{key} = {}: it must be a number from {low} to {high}, {advice}", value.get_ref());
            self.fault(value.span().start, what)
        })
    }

    fn parameters(&self, values: &BTreeMap<String, Spanned<f64>>) -> Result<Parameters, ConfigError> {
        let mut parameters = Parameters::default();
        for (name, value) in values {
            let at = |what| self.fault(value.span().start, format!("{name} = {}: {what}", value.get_ref()));
            if name == "GLN_ENABLE" {
                return Err(at("only a request in flight may engage: remove this line".into()));
            }
            if let Err(error) = parameters.set(name, *value.get_ref() as f32) {
                return Err(at(format!("{error}: correct or remove this line")));
            }
        }
        Ok(parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"model = "policy.onnx"
mission = "missions/city.toml"
autopilot = "udpin:127.0.0.1:14540"
radio = "serial:/dev/ttyUSB0:115200"
log_dir = "/var/log/gleaner"
component_id = 192
system_id = 7

[parameters]
GLN_W_DATA = 1
GLN_ALT = 75.5
"#;

    fn merged(setup: &Setup, text: &str) -> Result<Config, String> {
        merge(setup, &Source { path: Path::new("/etc/gleaner/gleaner.toml"), text })
            .map_err(|error| error.to_string())
    }

    fn fault(text: &str) -> String {
        let error = merged(&Setup::default(), text).err().unwrap();
        assert_eq!(error.lines().count(), 1, "{error}");
        error
    }

    #[test]
    fn paths_are_relative_to_the_file_and_flags_go_first() {
        let config = merged(&Setup::default(), TEXT).unwrap();
        assert_eq!(config.model, Path::new("/etc/gleaner/policy.onnx"));
        assert_eq!(config.engine, EngineKind::Tract);
        assert_eq!(config.mission, Path::new("/etc/gleaner/missions/city.toml"));
        assert_eq!(config.log_dir.as_deref(), Some(Path::new("/var/log/gleaner")));
        assert_eq!(
            config.settings,
            Settings { system_id: Some(7), component_id: 192, ..Settings::default() }
        );
        assert_eq!(config.parameters.altitude().0, 75.5);
        let setup = Setup {
            model: Some("other.onnx".into()),
            engine: Some(EngineKind::Native),
            autopilot: Some("tcpout:127.0.0.1:5760".parse().unwrap()),
            ..Setup::default()
        };
        let config = merged(&setup, TEXT).unwrap();
        assert_eq!(config.model, Path::new("other.onnx"));
        assert_eq!(config.engine, EngineKind::Native);
        assert_eq!(config.autopilot.to_string(), "tcpout:127.0.0.1:5760");
        assert_eq!(config.radio.unwrap().to_string(), "serial:/dev/ttyUSB0:115200");
    }

    #[test]
    fn faults_name_file_line_and_key_and_say_what_to_do() {
        let file = "config /etc/gleaner/gleaner.toml: ";
        let cases = [
            (
                "component_id = 192",
                "component_id = 1",
                "line 6: component_id = 1: it must be a number from 2 to 254, 191 to 194 are usual",
            ),
            (
                "system_id = 7",
                "system_id = 256",
                "line 7: system_id = 256: it must be a number from 1 to 254, or leave it out to adopt the autopilot's",
            ),
            (
                "GLN_W_DATA = 1",
                "GLN_ENABLE = 1",
                "line 10: GLN_ENABLE = 1: only a request in flight may engage: remove this line",
            ),
            (
                "GLN_W_DATA = 1",
                "GLN_DATA = 1",
                "line 10: GLN_DATA = 1: no such parameter: correct or remove this line",
            ),
        ];
        for (from, to, expected) in cases {
            assert_eq!(fault(&TEXT.replace(from, to)), format!("{file}{expected}"));
        }
        for (from, to, start) in [
            (
                "model =",
                "modle =",
                "line 1: unknown field `modle`, expected one of `model`, `engine`, `mission`",
            ),
            ("udpin:127.0.0.1:14540", "udpin:14540", "line 3: autopilot: 'udpin:14540' is not an endpoint: "),
            (
                "component_id",
                "engine = \"onnx\"\ncomponent_id",
                "line 6: engine = \"onnx\": an engine is tract or native",
            ),
            ("GLN_W_DATA = 1", "GLN_W_DATA = nan", "line 10: GLN_W_DATA = NaN: "),
            ("GLN_W_DATA = 1", "GLN_W_DATA = -1", "line 10: GLN_W_DATA = -1: "),
            ("GLN_ALT = 75.5", "GLN_ALT = 1e300", "line 11: GLN_ALT = 1"),
            ("system_id = 7", "system_id = \"7\"", "line 7: invalid type: string \"7\""),
            ("[parameters]", "[parameters", "line 9: "),
        ] {
            let error = fault(&TEXT.replace(from, to));
            assert!(error.starts_with(&format!("{file}{start}")), "{error}");
        }
        assert_eq!(
            fault(""),
            "no model is set: give --model, or write `model = \"policy.onnx\"` into the file given with --config"
        );
    }
}
