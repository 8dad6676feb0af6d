//! `gleaner check`: everything that can be known before take-off, as a table of findings.

mod listen;
mod mission;

use crate::args::Setup;
use crate::config::{self, Config};
use crate::error::StartError;
use crate::load;
use crate::logs::DecisionLog;
use crate::models::Installed;
use crate::radio::Radio;
use crate::run::open;
use gleaner_policy::{Engine, Policy};
use gleaner_ports::Peers;
use listen::Heard;
use std::process::ExitCode;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// Inferences that are timed; the median is printed.
const TIMED_INFERENCES: usize = 201;

/// Checks everything and prints one finding a line. 0 when nothing is at fault and the autopilot was heard, or not
/// listened for; 1 otherwise.
///
/// # Errors
/// The configuration cannot be read: there is nothing to check.
pub fn check(setup: &Setup, wait_s: u64) -> Result<ExitCode, StartError> {
    let config = config::resolve(setup)?;
    let mut findings = Findings::default();
    let mut devices = Vec::new();
    let file = setup.config.as_ref().map_or("flags only".into(), |path| path.display().to_string());
    findings.good("config", file);
    let loaded =
        findings.of("mission", load::mission(&config.mission), |loaded| mission::describe(&loaded.mission));
    if let Some(loaded) = loaded {
        mission::check(&mut findings, &loaded, &config.parameters);
        devices.extend(loaded.mission.devices.iter().map(|device| device.id));
    }
    check_models(&mut findings, &config);
    let heard = check_ports(&mut findings, &config, &devices, wait_s);
    if let Some(folder) = &config.log_dir {
        let (news, _) = channel();
        let opened = DecisionLog::open(folder, 0, config.log_limits, news).map(DecisionLog::close);
        findings.of("log", opened, |()| folder.display().to_string());
    }
    Ok(findings.verdict(heard))
}

/// Whether the autopilot was heard.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Heard,
    Silent,
    NotListened,
}

/// The table, printed as it grows.
#[derive(Default)]
struct Findings {
    failed: usize,
    warned: usize,
}

impl Findings {
    fn good(&mut self, what: &str, detail: impl AsRef<str>) {
        println!("ok    {what:<10} {}", detail.as_ref());
    }

    fn warn(&mut self, what: &str, detail: impl AsRef<str>) {
        self.warned += 1;
        println!("warn  {what:<10} {}", detail.as_ref());
    }

    fn bad(&mut self, what: &str, detail: impl AsRef<str>) {
        self.failed += 1;
        println!("FAIL  {what:<10} {}", detail.as_ref());
    }

    /// Prints the outcome and returns the value, if there is one.
    fn of<T, E: std::fmt::Display>(
        &mut self,
        what: &str,
        outcome: Result<T, E>,
        describe: impl FnOnce(&T) -> String,
    ) -> Option<T> {
        match &outcome {
            Ok(value) => self.good(what, describe(value)),
            Err(error) => self.bad(what, error.to_string()),
        }
        outcome.ok()
    }

    fn verdict(&self, heard: Verdict) -> ExitCode {
        let count = |count: usize, what: &str| match count {
            1 => format!("1 {what}"),
            _ => format!("{count} {what}s"),
        };
        let warnings =
            if self.warned > 0 { format!(", {}", count(self.warned, "warning")) } else { String::new() };
        if self.failed > 0 {
            println!("not ready: {}{warnings}", count(self.failed, "fault"));
            return ExitCode::FAILURE;
        }
        match heard {
            Verdict::Heard => println!("ready{warnings}"),
            Verdict::Silent => println!("ready, but no autopilot was heard{warnings}"),
            Verdict::NotListened => println!("ready, autopilot not listened for{warnings}"),
        }
        if heard == Verdict::Silent { ExitCode::FAILURE } else { ExitCode::SUCCESS }
    }
}

/// The configured model with its engine, and the other installed ones with the numbers that `GLN_MODEL` gives them.
fn check_models(findings: &mut Findings, config: &Config) {
    let installed = Installed::new(config);
    if let Some(model) = check_model(findings, &installed, 0) {
        check_engine(findings, model);
    }
    for number in 1..=installed.last() {
        check_model(findings, &installed, number);
    }
}

fn check_model(findings: &mut Findings, installed: &Installed, number: usize) -> Option<Engine> {
    let what = if number == 0 { "model".to_owned() } else { format!("model {number}") };
    findings.of(&what, installed.load(number), |model| {
        let trained = model
            .card()
            .map_or_else(String::new, |card| format!(", {} steps in {}", card.steps, card.scenario));
        let identity: String = model.sha256().chars().take(12).collect();
        let file = load::model_name(installed.file(number).flatten());
        format!("{} {}{trained}, sha256 {identity} ({})", model.name(), model.version(), file.display())
    })
}

/// The model was verified when it was loaded; here its speed is measured.
fn check_engine(findings: &mut Findings, mut model: Engine) {
    findings.good("engine", model.to_string());
    let goldens = model.goldens().to_vec();
    findings.good("self-test", format!("{} golden pairs reproduced", goldens.len()));
    let mut took = Vec::with_capacity(TIMED_INFERENCES);
    for golden in goldens.iter().cycle().take(TIMED_INFERENCES) {
        let start = Instant::now();
        if let Err(error) = model.infer(&golden.tokens) {
            return findings.bad("inference", format!("{error}: export the model again"));
        }
        took.push(start.elapsed());
    }
    took.sort_unstable();
    if let (Some(median), Some(longest)) = (took.get(took.len() / 2), took.last()) {
        findings.good("inference", format!("{} us, longest {} us", median.as_micros(), longest.as_micros()));
    }
}

/// Opens the ports and listens. `devices`: ids of the mission's devices.
fn check_ports(findings: &mut Findings, config: &Config, devices: &[u32], wait_s: u64) -> Verdict {
    let open_radio = |endpoint| {
        let opened = Radio::open(endpoint, config.radio_format);
        opened.map_err(|source| StartError::Port { role: "radio", source })
    };
    let mut radio = config.radio.as_ref().and_then(|endpoint| {
        findings.of("radio", open_radio(endpoint), |radio| radio.port().endpoint().to_string())
    });
    for endpoint in &config.ground {
        findings.of("ground", open("ground", endpoint, Peers::Bound), |port| port.endpoint().to_string());
    }
    let autopilot = open("autopilot", &config.autopilot, Peers::Bound);
    let link = findings.of("autopilot", autopilot, |port| port.endpoint().to_string());
    let Some(mut link) = link.filter(|_| wait_s > 0) else { return Verdict::NotListened };
    let heard = Heard::listen(&mut link, radio.as_mut(), Duration::from_secs(wait_s));
    if let Some(radio) = &radio {
        match heard.radio(radio, config.radio_format, devices) {
            Ok(reports) => findings.good("reports", reports),
            Err(fault) => findings.warn("reports", fault),
        }
    }
    if let Some(advice) = heard.no_station().filter(|_| config.ground.is_empty()) {
        findings.warn("station", advice);
    }
    if let Some(advice) = heard.dead_companion() {
        findings.warn("GUID_TIMEOUT", advice);
    }
    match heard.autopilot(&link) {
        Ok(name) => {
            findings.good("heartbeat", name);
            Verdict::Heard
        }
        Err(silence) => {
            findings.warn("heartbeat", format!("{silence} in {wait_s} s"));
            Verdict::Silent
        }
    }
}
