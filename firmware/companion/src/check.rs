//! `gleaner check`: everything that can be known before take-off, as a table of findings.

use crate::args::Setup;
use crate::config::{self, Config};
use crate::error::StartError;
use crate::load;
use crate::log::DecisionLog;
use crate::run::open;
use gleaner_link::{Firmware, FrameDecoder, Message};
use gleaner_pilot::Mission;
use gleaner_policy::{Engine, Policy};
use gleaner_ports::{Port, RECEIVE_BYTES, wait};
use gleaner_units::BatteryUnits;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Inferences that are timed; the median is told.
const TIMED_INFERENCES: usize = 201;

/// Checks everything and prints one finding a line. 0 when all are good, 1 otherwise.
///
/// # Errors
/// The configuration cannot be read: there is nothing to check.
pub fn check(setup: &Setup, wait_s: u64) -> Result<ExitCode, StartError> {
    let config = config::resolve(setup)?;
    let mut findings = Findings::default();
    let file = setup.config.as_ref().map_or("flags only".into(), |path| path.display().to_string());
    findings.good("config", file);
    if let Some(mission) = findings.of("mission", load::mission(&config.mission), describe) {
        check_mission(&mut findings, &mission, &config);
    }
    let model = findings.of("model", load::model(&config.model, config.engine), |model| {
        let trained = model
            .card()
            .map_or_else(String::new, |card| format!(", {} steps in {}", card.steps, card.scenario));
        let identity: String = model.sha256().chars().take(12).collect();
        format!("{} {}{trained}, sha256 {identity}", model.name(), model.version())
    });
    if let Some(model) = model {
        check_engine(&mut findings, model);
    }
    check_ports(&mut findings, &config, wait_s);
    if let Some(folder) = &config.log_dir {
        let opened = DecisionLog::open(folder).map(DecisionLog::close);
        findings.of("log", opened, |()| folder.display().to_string());
    }
    Ok(findings.verdict())
}

/// The table, printed as it grows.
#[derive(Default)]
struct Findings {
    failed: usize,
}

impl Findings {
    fn good(&mut self, what: &str, detail: impl AsRef<str>) {
        println!("ok    {what:<10} {}", detail.as_ref());
    }

    fn bad(&mut self, what: &str, detail: impl AsRef<str>) {
        self.failed += 1;
        println!("FAIL  {what:<10} {}", detail.as_ref());
    }

    /// Tells how it went, and hands over what there is.
    fn of<T>(
        &mut self,
        what: &str,
        outcome: Result<T, StartError>,
        describe: impl FnOnce(&T) -> String,
    ) -> Option<T> {
        match &outcome {
            Ok(value) => self.good(what, describe(value)),
            Err(error) => self.bad(what, error.to_string()),
        }
        outcome.ok()
    }

    fn verdict(&self) -> ExitCode {
        if self.failed == 0 {
            println!("ready");
            return ExitCode::SUCCESS;
        }
        let faults = if self.failed == 1 { "1 fault".to_owned() } else { format!("{} faults", self.failed) };
        println!("not ready: {faults}");
        ExitCode::FAILURE
    }
}

fn describe(mission: &Mission) -> String {
    let grid = mission.grid();
    format!(
        "{} x {} cells of {} m, {} inside the fence, {} devices with {} data units, terminal {}",
        grid.width(),
        grid.height(),
        grid.cell().0,
        mission.fence.len(),
        mission.devices.len(),
        mission.initial_data(),
        mission.terminal,
    )
}

fn check_mission(findings: &mut Findings, mission: &Mission, config: &Config) {
    let parameters = &config.parameters;
    let guard = match mission.guard(parameters.reserve()) {
        Ok(guard) => guard,
        Err(error) => return findings.bad("way home", format!("{error}: correct the mission")),
    };
    let (budget, reserve) = (mission.budget.0, parameters.reserve().0);
    let cells = || mission.grid().cells().filter(|&cell| mission.fence.contains(cell));
    let cut_off = cells().filter(|&cell| guard.distance(cell).is_none()).count();
    let covered = cells().filter(|&cell| guard.is_feasible(cell, mission.budget)).count();
    if cut_off > 0 {
        findings.bad("way home", format!("{cut_off} cells inside the fence are cut off from the terminal: widen the fence, or exclude them"));
    } else if covered == 0 {
        findings.bad("way home", format!("{budget} battery units do not cover the shortest way home and {reserve} in reserve: raise battery_units or lower GLN_RESERVE"));
    } else {
        let of = mission.fence.len();
        findings.good(
            "way home",
            format!("{budget} battery units, {reserve} in reserve: may engage over {covered} of {of} cells"),
        );
    }
    let full = parameters.full_battery();
    if full.0 < budget {
        findings.bad("battery", format!("the mission wants {budget} units, a full battery is {}: lower battery_units or correct GLN_BAT_UNITS", full.0));
    } else {
        findings.good(
            "battery",
            format!(
                "the mission takes {:.0} % of a full battery of {} units",
                percent(mission.budget, full),
                full.0
            ),
        );
    }
    let (altitude, tallest) = (parameters.altitude().0, mission.heights.tallest().0);
    if altitude <= tallest {
        findings.bad(
            "altitude",
            format!("{altitude} m is not above the tallest building of {tallest} m: raise GLN_ALT"),
        );
    } else {
        findings.good("altitude", format!("{altitude} m, tallest building {tallest} m"));
    }
}

fn percent(part: BatteryUnits, whole: BatteryUnits) -> f32 {
    100.0 * part.0 / whole.0
}

/// The model has proved itself when it was loaded; here its speed is measured.
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

fn check_ports(findings: &mut Findings, config: &Config, wait_s: u64) {
    if let Some(endpoint) = &config.radio {
        findings.of("radio", open("radio", endpoint), |port| port.endpoint().to_string());
    }
    let link =
        findings.of("autopilot", open("autopilot", &config.autopilot), |port| port.endpoint().to_string());
    if let Some(mut link) = link
        && wait_s > 0
    {
        match hear_autopilot(&mut link, Duration::from_secs(wait_s)) {
            Some(heard) => findings.good("heartbeat", heard),
            None => findings.bad(
                "heartbeat",
                format!("no autopilot heard in {wait_s} s: check wiring and baud rate, and that it speaks MAVLink on this port"),
            ),
        }
    }
}

/// Listens for an autopilot's heartbeat, without saying anything.
fn hear_autopilot(link: &mut Port, at_most: Duration) -> Option<String> {
    let start = Instant::now();
    let mut decoder = FrameDecoder::new();
    let mut buffer = [0; RECEIVE_BYTES];
    loop {
        link.maintain(Instant::now());
        let bytes = link.receive(&mut buffer);
        let mut rest = &buffer[..bytes];
        while !rest.is_empty() {
            let taken = decoder.push(rest);
            rest = &rest[taken..];
            while let Some(frame) = decoder.next_frame() {
                if let Ok(Some(Message::Heartbeat(heartbeat))) = Message::decode(&frame)
                    && let Some(name) = firmware_name(Firmware::from_wire(heartbeat.autopilot))
                {
                    return Some(format!("{name}, system id {}", frame.sender.system));
                }
            }
        }
        let left = at_most.checked_sub(start.elapsed())?;
        if bytes == 0 {
            wait(&[link], left.min(Duration::from_millis(200))).ok()?;
        }
    }
}

fn firmware_name(firmware: Firmware) -> Option<&'static str> {
    match firmware {
        Firmware::ArduPilot => Some("ArduPilot"),
        Firmware::Px4 => Some("PX4"),
        Firmware::Other(_) => None,
    }
}
