//! `gleaner run`: the flight loop.
//!
//! Bytes are taken in as they come; every 20 ms the pilot is polled, and what it wants to say is sent. Setpoints
//! and heartbeat hang off that poll: when this loop stops, both stop, and the autopilot's own failsafes act.

use crate::args::Setup;
use crate::clock;
use crate::config::{self, Config};
use crate::error::StartError;
use crate::load;
use crate::log::DecisionLog;
use gleaner_link::{MAX_FRAME_BYTES, Severity};
use gleaner_pilot::{Onboard, POLL_INTERVAL, State};
use gleaner_policy::{Engine, Timed};
use gleaner_ports::{Port, RECEIVE_BYTES, State as PortState, wait};
use std::io::IsTerminal;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use tracing_appender::non_blocking::WorkerGuard;

/// Time between polls of the pilot.
const TICK: Duration = Duration::from_micros(POLL_INTERVAL.as_micros());
/// Reads per port and wake-up: a flood on one port must not starve the poll.
const READS_PER_WAKE: usize = 32;
/// How long the last words may take: status texts leave at ten a second.
const GOODBYE: Duration = Duration::from_millis(300);

/// Opens everything, then flies until interrupted.
///
/// # Errors
/// Something could not be opened; nothing was sent then.
pub fn run(setup: &Setup) -> Result<ExitCode, StartError> {
    let config = config::resolve(setup)?;
    let mission = load::mission(&config.mission)?;
    let engine = load::model(&config.model, config.engine)?;
    let model = format!("{}, engine {engine}", engine.name());
    // The engine reproduced its golden pairs, or it would not have been loaded.
    let onboard = Onboard::new(
        mission,
        config.parameters.clone(),
        config.settings,
        Timed::new(engine, clock::now),
        Ok(()),
    )
    .map_err(|source| StartError::Refused { path: config.mission.clone(), source })?;
    let log = config.log_dir.as_deref().map(DecisionLog::open).transpose()?;
    let link = open("autopilot", &config.autopilot)?;
    let radio = config.radio.as_ref().map(|endpoint| open("radio", endpoint)).transpose()?;
    let stop = gleaner_ports::end_requested().map_err(StartError::Signals)?;
    let _messages = start_messages();
    introduce(&config, &model, &link, radio.as_ref());
    let mut flight = Flight { onboard, link, radio, log, said: State::Boot };
    flight.fly(|| stop.load(Ordering::Relaxed));
    flight.end();
    Ok(ExitCode::SUCCESS)
}

/// Opens the port for `role`.
pub fn open(role: &'static str, endpoint: &gleaner_ports::Endpoint) -> Result<Port, StartError> {
    Port::open(endpoint).map_err(|source| StartError::Port { role, source })
}

/// Messages go to stderr from here on, until what it gives is dropped; before, stderr holds at most the one line of an
/// error. They leave on a thread of their own: a terminal that is held, a log that nobody takes or a full disk must not
/// hold the flight.
fn start_messages() -> WorkerGuard {
    let (writer, guard) = tracing_appender::non_blocking(std::io::stderr());
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(writer)
        // There is no other place to say that it cannot be said.
        .log_internal_errors(false)
        .with_target(false)
        .init();
    guard
}

fn introduce(config: &Config, model: &str, link: &Port, radio: Option<&Port>) {
    tracing::info!("gleaner {} with model {model} ({})", env!("CARGO_PKG_VERSION"), config.model.display());
    for (role, port) in [("autopilot", Some(link)), ("radio", radio)] {
        if let Some(port) = port {
            let at =
                port.local_address().map_or_else(String::new, |address| format!(", local address {address}"));
            tracing::info!("{role} port {} is open{at}", port.endpoint());
        }
    }
}

struct Flight {
    onboard: Onboard<Timed<Engine>>,
    link: Port,
    radio: Option<Port>,
    log: Option<DecisionLog>,
    said: State,
}

impl Flight {
    fn fly(&mut self, is_over: impl Fn() -> bool) {
        let mut next_tick = Instant::now();
        while !is_over() {
            self.hear();
            let now = Instant::now();
            if now >= next_tick {
                self.tick(now);
                next_tick = (next_tick + TICK).max(now);
            }
            self.speak();
            self.rest(next_tick.saturating_duration_since(Instant::now()));
        }
    }

    fn hear(&mut self) {
        let mut buffer = [0; RECEIVE_BYTES];
        for _ in 0..READS_PER_WAKE {
            let bytes = self.link.receive(&mut buffer);
            if bytes == 0 {
                break;
            }
            self.onboard.receive_link(clock::now(), &buffer[..bytes]);
        }
        let Some(radio) = &mut self.radio else { return };
        for _ in 0..READS_PER_WAKE {
            let bytes = radio.receive(&mut buffer);
            if bytes == 0 {
                break;
            }
            self.onboard.receive_radio(clock::now(), &buffer[..bytes]);
        }
    }

    fn tick(&mut self, now: Instant) {
        self.mend(now);
        self.onboard.poll(clock::at(now));
        let took = self.onboard.policy().take();
        if let Some(took) = took {
            self.onboard.set_inference_time(took);
        }
        if let Some(decision) = self.onboard.decision() {
            let (cell, action, battery) = (decision.cell, decision.action.name(), decision.battery.0);
            tracing::debug!("decision {}: {action} at {cell}, battery {battery}", decision.sequence);
            if let Some(log) = &mut self.log {
                log.write(decision, took);
            }
        }
        let state = self.onboard.state();
        if state != self.said {
            tracing::info!("{} -> {}", self.said.name(), state.name());
            self.said = state;
        }
    }

    /// Says once what went down or came back; a lost port opens again by itself.
    fn mend(&mut self, now: Instant) {
        for (role, port) in [("autopilot", Some(&mut self.link)), ("radio", self.radio.as_mut())] {
            let Some(port) = port else { continue };
            let Some(state) = port.maintain(now) else { continue };
            // About the autopilot's own port the operator hears when it is back.
            match state {
                PortState::Up => {
                    tracing::info!("{role} port {} is back", port.endpoint());
                    self.onboard.say(Severity::Notice, format_args!("gleaner: {role} port is back"));
                }
                PortState::Down(reason) => {
                    tracing::warn!(
                        "{role} port {} is down: {reason}: trying to open it again",
                        port.endpoint()
                    );
                    self.onboard.say(Severity::Warning, format_args!("gleaner: {role} port down, retrying"));
                }
            }
        }
    }

    fn speak(&mut self) {
        let mut frame = [0; MAX_FRAME_BYTES];
        loop {
            let bytes = self.onboard.transmit(&mut frame);
            if bytes == 0 {
                return;
            }
            self.link.send(&frame[..bytes]);
        }
    }

    fn rest(&self, at_most: Duration) {
        let ports = [Some(&self.link), self.radio.as_ref()];
        let ports: Vec<&Port> = ports.into_iter().flatten().collect();
        if wait(&ports, at_most).is_err() {
            // Without the system's help, look at the ports once a tick.
            std::thread::sleep(at_most);
        }
    }

    /// Says goodbye. Nothing is sent after that: to the autopilot, the silence is the message.
    fn end(mut self) {
        let flying = matches!(self.onboard.state(), State::Engaged | State::Homing);
        if flying {
            self.onboard.say(Severity::Critical, format_args!("gleaner: stopped in flight, take over now"));
            tracing::warn!(
                "stopped in flight: ArduPilot holds its last target until somebody takes over, PX4 leaves OFFBOARD"
            );
        } else {
            self.onboard.say(Severity::Warning, format_args!("gleaner: stopped"));
        }
        let end = Instant::now() + GOODBYE;
        self.fly(|| Instant::now() >= end);
        let decisions = self.onboard.stats().decisions;
        tracing::info!("stopped after {decisions} decisions: setpoints and heartbeat have ended");
        if let Some(log) = self.log {
            log.close();
        }
    }
}
