//! The configuration: the values of the file, overridden by flags, all checked.
//!
//! ```toml
//! model = "policy.onnx"                       # optional; paths are relative to this file
//! models = ["mine.onnx"]                      # optional: more models, chosen by GLN_MODEL 1, 2, ...
//! engine = "native"                           # optional: native or tract
//! mission = "mission.toml"
//! autopilot = "serial:/dev/ttyAMA0:921600"
//! ground = ["udpout:192.168.1.10:14550"]      # optional: more MAVLink ports
//! radio = "serial:/dev/ttyUSB0:115200"        # optional: reports may also arrive by TUNNEL
//! radio_format = "cobs"                       # or "json_lines", "semtech_udp"
//! operators = ["255", "245/190"]              # who may command: SYSTEM, SYSTEM/COMPONENT or */COMPONENT
//! log_dir = "log"                             # optional
//! state_dir = "state"                         # optional
//! component_id = 191                          # optional
//! system_id = 1                               # optional: needed where several autopilots are on the link
//! on_stop = "return"                          # or "hold": what is requested when the program ends in flight
//!
//! [signing]                                   # optional
//! key = "signing.key"                         # 64 hexadecimal digits or a passphrase, mode 600
//! ports = ["ground"]                          # or "autopilot"
//!
//! [page]                                      # optional
//! http = "127.0.0.1:8080"                     # the live page: a port, or ADDRESS:PORT
//! view_token = "..."                          # for other computers: at least 16 letters, digits, '-' or '_'
//! control_token = "..."                       # without tokens random ones are printed at the start
//!
//! [log]                                       # optional
//! telemetry = true                            # flight.tlog beside decisions.jsonl
//! file_mb = 64                                # a longer file is renamed; eight old ones are kept
//! min_free_mb = 256                           # space left on the disk
//!
//! [parameters]                                # optional: initial values, as PARAM_SET would set them
//! GLN_W_DATA = 0.5
//! ```

mod file;

use crate::args::Setup;
use crate::logs::Limits;
use crate::text::{self, TextFault};
use file::Source;
use gleaner_dashboard::Token;
use gleaner_link::{ParameterId, Parameters};
use gleaner_pilot::Settings;
use gleaner_policy::EngineKind;
use gleaner_ports::Endpoint;
use gleaner_radio::Calibration;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Format of the radio's reports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum RadioFormat {
    /// Postcard in COBS.
    #[default]
    Cobs,
    /// One JSON object per line or datagram.
    JsonLines(Calibration),
    /// The Semtech UDP packet forwarder protocol.
    SemtechUdp(Calibration),
}

/// Most entries of `models`: the range of `GLN_MODEL`.
const MOST_MODELS: usize = 16;

/// Everything that a run needs.
pub struct Config {
    /// The model file; without one the built-in model.
    pub model: Option<PathBuf>,
    /// Further models, chosen by `GLN_MODEL` from 1 on.
    pub models: Vec<PathBuf>,
    /// What runs the model; `None` leaves the choice to the model.
    pub engine: Option<EngineKind>,
    /// The mission file.
    pub mission: PathBuf,
    /// Port to the autopilot.
    pub autopilot: Endpoint,
    /// Ports to ground stations.
    pub ground: Vec<Endpoint>,
    /// Port to the radio.
    pub radio: Option<Endpoint>,
    /// Format of the radio's reports.
    pub radio_format: RadioFormat,
    /// Folder of the logs.
    pub log_dir: Option<PathBuf>,
    /// Folder of what outlives a run.
    pub state_dir: Option<PathBuf>,
    /// Whether `flight.tlog` is written.
    pub telemetry_log: bool,
    /// How much of the disk the logs may take.
    pub log_limits: Limits,
    /// Our ids on the link.
    pub settings: Settings,
    /// Initial values.
    pub parameters: Parameters,
    /// Message signing, where a port needs it.
    pub signing: Option<SigningConfig>,
    /// Where the live page is served.
    pub http: Option<SocketAddr>,
    /// The tokens to view and to control the page; without them random ones, or none on a loopback address.
    pub page_tokens: Option<[Token; 2]>,
}

/// Message signing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SigningConfig {
    /// The key file.
    pub key: PathBuf,
    /// Roles of the ports that sign: `autopilot`, `ground`.
    pub ports: Vec<String>,
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
    /// The file is not text.
    #[error("config {}: {source}", .path.display())]
    Text {
        /// Where.
        path: PathBuf,
        /// Why.
        source: TextFault,
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
    /// Neither the file nor a flag sets a value that is needed.
    #[error(
        "no {key} is set: give --{key}, or write `{key} = \"{example}\"` into the file given with --config"
    )]
    Missing {
        /// The key, which is also the flag.
        key: &'static str,
        /// A good value.
        example: &'static str,
    },
}

/// The values to use: flags first, then the file, then the folders that systemd gives to a service.
///
/// # Errors
/// The first fault, see [`ConfigError`].
pub fn resolve(setup: &Setup) -> Result<Config, ConfigError> {
    let text = setup.config.as_deref().map(read).transpose()?.unwrap_or_default();
    let path = setup.config.as_deref().unwrap_or(Path::new(""));
    merge(setup, &Source { path, text: &text }, |name| env::var_os(name).map(PathBuf::from))
}

/// The parameters of a computer with an operating system: look-ahead is on.
#[must_use]
pub fn default_parameters() -> Parameters {
    let mut parameters = Parameters::default();
    // 1 is in the parameter's range.
    let _ = parameters.set_id(ParameterId::Lookahead, 1.0);
    parameters
}

/// The parameters that the file at `path` sets, the others at their defaults. Nothing else of the file is checked.
///
/// # Errors
/// The file cannot be read, is no configuration, or holds a parameter out of its range.
pub fn parameters(path: &Path) -> Result<Parameters, ConfigError> {
    let text = read(path)?;
    let source = Source { path, text: &text };
    source.parameters(&source.parse()?.parameters)
}

/// The ids and the parameters that the file at `path` sets, the others at their defaults.
///
/// # Errors
/// As [`parameters`].
pub fn identity(path: &Path) -> Result<(Settings, Parameters), ConfigError> {
    let text = read(path)?;
    let source = Source { path, text: &text };
    let file = source.parse()?;
    Ok((source.settings(&file)?, source.parameters(&file.parameters)?))
}

fn read(path: &Path) -> Result<String, ConfigError> {
    let bytes = fs::read(path).map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
    text::decode(bytes).map_err(|source| ConfigError::Text { path: path.to_owned(), source })
}

fn merge(
    setup: &Setup,
    source: &Source<'_>,
    variable: impl Fn(&str) -> Option<PathBuf>,
) -> Result<Config, ConfigError> {
    let file = source.parse()?;
    let folder = source.path.parent().unwrap_or(Path::new(""));
    let path = |flag: &Option<PathBuf>, key: &Option<PathBuf>| {
        flag.clone().or_else(|| key.as_ref().map(|path| folder.join(path)))
    };
    let missing = |key, example| ConfigError::Missing { key, example };
    // All of the file is checked, including what a flag overrides: a fault must not appear on another day.
    let autopilot = file.autopilot.as_ref().map(|text| source.endpoint("autopilot", text)).transpose()?;
    let ground: Vec<Endpoint> =
        file.ground.iter().map(|text| source.endpoint("ground", text)).collect::<Result<_, _>>()?;
    let engine = file.engine.as_ref().map(|name| source.engine(name)).transpose()?;
    let radio = file.radio.as_ref().map(|text| source.endpoint("radio", text)).transpose()?;
    Ok(Config {
        settings: source.settings(&file)?,
        parameters: source.parameters(&file.parameters)?,
        log_limits: source.limits(&file.log)?,
        telemetry_log: file.log.telemetry,
        signing: source.signing(&file, folder)?,
        http: setup.http.or(source.http(&file.page)?),
        page_tokens: source.page_tokens(&file.page)?,
        model: path(&setup.model, &file.model),
        models: source.models(&file)?.iter().map(|model| folder.join(model)).collect(),
        engine: setup.engine.or(engine),
        mission: path(&setup.mission, &file.mission).ok_or(missing("mission", "mission.toml"))?,
        autopilot: setup
            .autopilot
            .clone()
            .or(autopilot)
            .ok_or(missing("autopilot", "serial:/dev/ttyAMA0:921600"))?,
        ground: if setup.ground.is_empty() { ground } else { setup.ground.clone() },
        radio: setup.radio.clone().or(radio),
        radio_format: source.radio_format(&file)?,
        log_dir: path(&setup.log_dir, &file.log_dir).or_else(|| variable("LOGS_DIRECTORY")),
        state_dir: path(&setup.state_dir, &file.state_dir).or_else(|| variable("STATE_DIRECTORY")),
    })
}

#[cfg(test)]
mod tests;
