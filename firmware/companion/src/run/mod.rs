//! `gleaner run`: opens everything, then serves an autopilot until interrupted.

mod console;
mod files;
mod flight;
mod page;
mod service;

use crate::args::{self, Setup};
use crate::config::{self, Config, SigningConfig};
use crate::error::StartError;
use crate::keep::{LastRun, LastRunFile, ParameterFile};
use crate::load;
use crate::logs::{self, DecisionLog, LogNews, TelemetryLog};
use crate::models::{self, Installed, Models};
use crate::radio::Radio;
use crate::routing::{Links, SignedPort, read_key};
use console::Console;
use flight::Flight;
use gleaner_link::Parameters;
use gleaner_pilot::{Budget, Onboard};
use gleaner_ports::{Endpoint, Peers, Port};
use page::Page;
use service::Service;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::time::{SystemTime, UNIX_EPOCH};

/// Opens everything, then flies until interrupted.
///
/// # Errors
/// Something could not be opened; nothing was sent then.
pub fn run(order: &args::Run) -> Result<ExitCode, StartError> {
    let config = config::resolve(&order.setup)?;
    let load::Loaded { mission, rounded } = load::mission(&config.mission)?;
    let installed = Installed::new(&config);
    let (kept, mut parameters, mut lines) = Kept::open(&config, order.reset_parameters)?;
    let (engine, number, refused) = installed.first(&mut parameters)?;
    lines.extend(refused);
    let file = load::model_name(installed.file(number).flatten());
    let model = format!("{}, engine {engine}", engine.name());
    let page = Page::open(&config, &mission, &parameters, &model)?;
    // The engine reproduced its golden pairs, or it would not have been loaded.
    let policy = models::policy(engine);
    let models = Models::start(installed, number);
    let onboard = Onboard::new(mission, parameters, config.settings, policy, Ok(()))
        .map_err(|source| StartError::Refused { path: config.mission.clone(), source })?;
    let logs = Logs::open(&config)?;
    if let Some(folder) = &config.log_dir
        && let Err(error) = logs::keep_mission(folder, onboard.machine().mission())
    {
        lines.push(format!("{}: {error}: `gleaner report` will need --mission", logs::MISSION));
    }
    let links = open_links(&config)?;
    let open_radio = |endpoint| {
        let opened = Radio::open(endpoint, config.radio_format);
        opened.map_err(|source| StartError::Port { role: "radio", source })
    };
    let radio = config.radio.as_ref().map(open_radio).transpose()?;
    let stop = gleaner_ports::end_requested().map_err(StartError::Signals)?;
    let console = Console::start(order.verbose);
    introduce(
        &config,
        &order.setup,
        &format!("{model} ({})", file.display()),
        &links,
        radio.as_ref().map(Radio::port),
    );
    tracing::info!("{}", lookahead(onboard.parameters().looks_ahead()));
    for line in page.introduction(config.page_tokens.is_some()) {
        tracing::info!("{line}");
    }
    for line in &lines {
        tracing::info!("{line}");
    }
    if rounded > 0 {
        tracing::info!("{rounded} building heights had decimals and were rounded up to whole metres");
    }
    for refused in service::become_real_time() {
        tracing::info!("not real time: {refused}");
    }
    let mut flight =
        Flight::new((onboard, models), links, radio, logs, kept, (console, page), Service::new());
    flight.fly(|| stop.load(Ordering::Relaxed));
    flight.end();
    Ok(ExitCode::SUCCESS)
}

/// Opens the port for `role`.
///
/// # Errors
/// The port cannot be opened.
pub fn open(role: &'static str, endpoint: &Endpoint, peers: Peers) -> Result<Port, StartError> {
    Port::open_for(endpoint, peers).map_err(|source| StartError::Port { role, source })
}

fn open_links(config: &Config) -> Result<Links, StartError> {
    let mut ports = vec![("autopilot", open("autopilot", &config.autopilot, Peers::Bound)?)];
    for endpoint in &config.ground {
        ports.push(("ground", open("ground", endpoint, Peers::Bound)?));
    }
    let mut links = Vec::new();
    for (number, (role, port)) in (0..=u8::MAX).zip(ports) {
        links.push((role, port, signing(config, role, number)?));
    }
    Ok(Links::new(links))
}

/// The signing of a port, if the configuration asks for it.
fn signing(config: &Config, role: &str, number: u8) -> Result<Option<SignedPort>, StartError> {
    let wanted = |signing: &&SigningConfig| signing.ports.iter().any(|port| port == role);
    let Some(signing) = config.signing.as_ref().filter(wanted) else { return Ok(None) };
    let key =
        read_key(&signing.key).map_err(|source| StartError::Signing { path: signing.key.clone(), source })?;
    SignedPort::open(key, number, config.state_dir.as_deref())
        .map(Some)
        .map_err(|(path, source)| StartError::Signing { path, source })
}

fn introduce(config: &Config, setup: &Setup, model: &str, links: &Links, radio: Option<&Port>) {
    tracing::info!("gleaner {} with model {model}", env!("CARGO_PKG_VERSION"));
    for (role, port) in links.ports().chain(radio.map(|port| ("radio", port))) {
        let at =
            port.local_address().map_or_else(String::new, |address| format!(", local address {address}"));
        tracing::info!("{role} port {} is open{at}", port.endpoint());
    }
    if config.state_dir.is_none() {
        let how = if setup.config.is_some() { "state_dir" } else { "--state" };
        tracing::info!("parameters set from the ground end with this run: {how} keeps them");
    }
}

/// What decides, by `GLN_LOOKAHEAD`.
fn lookahead(is_on: bool) -> String {
    if is_on {
        format!(
            "look-ahead is on, up to {} tours per decision: GLN_LOOKAHEAD 0 switches it off",
            Budget::LINUX.tours
        )
    } else {
        "look-ahead is off, the network decides alone: GLN_LOOKAHEAD 1 switches it on".to_owned()
    }
}

/// Seconds since 1970.
fn unix_time_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

/// The logs of a run, and what they report.
struct Logs {
    decisions: Option<DecisionLog>,
    telemetry: Option<TelemetryLog>,
    news: Receiver<LogNews>,
}

impl Logs {
    fn open(config: &Config) -> Result<Logs, StartError> {
        let (sender, news) = channel();
        let (mut decisions, mut telemetry) = (None, None);
        if let Some(folder) = &config.log_dir {
            decisions = Some(DecisionLog::open(folder, unix_time_s(), config.log_limits, sender.clone())?);
            if config.telemetry_log {
                telemetry = Some(TelemetryLog::open(folder, config.log_limits, sender)?);
            }
        }
        Ok(Logs { decisions, telemetry, news })
    }

    fn close(self) {
        if let Some(decisions) = self.decisions {
            decisions.close();
        }
        if let Some(telemetry) = self.telemetry {
            telemetry.close();
        }
    }
}

/// What outlives the run.
struct Kept {
    parameters: ParameterFile,
    this_run: LastRunFile,
    last_run: Option<LastRun>,
}

impl Kept {
    /// The state folder if there is one, the parameters to start with, and lines for the console.
    fn open(config: &Config, reset: bool) -> Result<(Option<Kept>, Parameters, Vec<String>), StartError> {
        let Some(folder) = &config.state_dir else {
            return Ok((None, config.parameters.clone(), Vec::new()));
        };
        if reset {
            ParameterFile::reset(folder)?;
        }
        let (file, parameters, lines) = ParameterFile::open(folder, &config.parameters)?;
        let (this_run, last_run) = LastRunFile::open(folder, unix_time_s());
        Ok((Some(Kept { parameters: file, this_run, last_run }), parameters, lines))
    }
}
