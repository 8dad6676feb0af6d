//! What the console shows: every status text that a ground station gets, and the messages of this program.

use crate::routing::Packet;
use gleaner_link::{Address, Component};
use gleaner_pilot::{Decision, State};
use std::io::IsTerminal;
use tracing_appender::non_blocking::WorkerGuard;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

const HEARTBEAT: u32 = 0;
const STATUSTEXT: u32 = 253;

/// The console. Messages leave on a thread of their own until it is dropped: a stopped terminal, a closed pipe or a full
/// disk must not stop the decision loop.
pub struct Console {
    _writer: WorkerGuard,
    reported: State,
    /// The vehicle that was introduced last: its address and `MAV_TYPE`.
    serving: Option<(Address, u8)>,
}

impl Console {
    /// Starts to print messages on stderr. Before this only the line of an error is printed. `RUST_LOG` overrides
    /// `verbose`.
    pub fn start(verbose: bool) -> Console {
        let (writer, guard) = tracing_appender::non_blocking(std::io::stderr());
        let level = if verbose { LevelFilter::DEBUG } else { LevelFilter::INFO };
        let asked = std::env::var("RUST_LOG").ok().filter(|text| !text.is_empty());
        let filter = asked.and_then(|text| text.parse::<Targets>().ok());
        let lines = tracing_subscriber::fmt::layer()
            .with_ansi(std::io::stderr().is_terminal())
            .with_writer(writer)
            // A failure to print cannot be printed.
            .log_internal_errors(false)
            .with_target(false)
            .with_filter(filter.unwrap_or_else(|| Targets::new().with_default(level)));
        tracing_subscriber::registry().with(lines).init();
        Console { _writer: guard, reported: State::Boot, serving: None }
    }

    /// A packet of ours: a status text is printed as the ground station shows it.
    pub fn sent(&self, packet: &Packet) {
        let Some((severity, text)) = status_text(packet) else { return };
        // MAVLink's severities are those of RFC 5424: 3 is an error, 4 a warning.
        match severity {
            0..=3 => tracing::error!("{text}"),
            4 => tracing::warn!("{text}"),
            5 | 6 => tracing::info!("{text}"),
            _ => tracing::debug!("{text}"),
        }
    }

    /// A packet of another component. The vehicle is introduced at its first heartbeat.
    pub fn received(&mut self, packet: &Packet, link: &Component) {
        let Some(autopilot) = link.autopilot().address() else { return };
        if packet.message_id != HEARTBEAT || packet.sender != (autopilot.system, autopilot.component) {
            return;
        }
        let Some((firmware, vehicle)) = heartbeat(packet) else { return };
        if self.serving != Some((autopilot, vehicle)) {
            self.serving = Some((autopilot, vehicle));
            let own = link.address();
            tracing::info!(
                "serving {} on {}, system {}, as component {}",
                firmware_name(firmware),
                vehicle_name(vehicle),
                autopilot.system,
                own.component
            );
        }
    }

    /// One line for a change of state; whether it has changed.
    pub fn state(&mut self, state: State) -> bool {
        let changed = state != self.reported;
        if changed {
            tracing::info!("{} -> {}", self.reported.name(), state.name());
            self.reported = state;
        }
        changed
    }

    /// One line a decision.
    pub fn decision(&self, decision: &Decision) {
        let Decision { sequence, cell, action, battery, spare, collected, preference, .. } = decision;
        let (action, w_data) = (action.name(), preference.w_data());
        let (battery, spare, collected) = (battery.0, spare.0, 100.0 * collected);
        tracing::debug!(
            "decision {sequence}: {action} at {cell}, w {w_data}, battery {battery}, spare {spare}, collected {collected:.0} %"
        );
    }
}

/// Severity and text. MAVLink 2 leaves out trailing zeros.
fn status_text(packet: &Packet) -> Option<(u8, String)> {
    let (&severity, text) = packet.payload().split_first().filter(|_| packet.message_id == STATUSTEXT)?;
    let text: Vec<u8> = text.iter().copied().take(50).take_while(|&byte| byte != 0).collect();
    Some((severity, String::from_utf8_lossy(&text).into_owned()))
}

/// `MAV_AUTOPILOT` and `MAV_TYPE`.
fn heartbeat(packet: &Packet) -> Option<(u8, u8)> {
    let payload = packet.payload();
    Some((*payload.get(5)?, *payload.get(4)?))
}

/// `MAV_AUTOPILOT` of the MAVLink common message set.
fn firmware_name(autopilot: u8) -> String {
    match autopilot {
        3 => "ArduPilot".to_owned(),
        12 => "PX4".to_owned(),
        other => format!("firmware {other}"),
    }
}

/// `MAV_TYPE` of the MAVLink common message set.
fn vehicle_name(vehicle: u8) -> String {
    let name = match vehicle {
        1 => "a fixed-wing aircraft",
        2 => "a quadrotor",
        3 => "a coaxial helicopter",
        4 => "a helicopter",
        10 => "a rover",
        11 => "a boat",
        13 => "a hexarotor",
        14 => "an octorotor",
        15 => "a tricopter",
        29 => "a dodecarotor",
        35 => "a decarotor",
        other => return format!("vehicle type {other}"),
    };
    name.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(message_id: u32, payload: &[u8]) -> Packet {
        let mut bytes = vec![0xFD, payload.len() as u8, 0, 0, 0, 1, 1, message_id as u8, 0, 0];
        bytes.extend(payload);
        bytes.extend([0, 0]);
        Packet { bytes, sender: (1, 1), message_id, target: None, verified: true }
    }

    #[test]
    fn texts_and_heartbeats_are_read() {
        let text = packet(STATUSTEXT, b"\x04gleaner: waiting");
        assert_eq!(status_text(&text), Some((4, "gleaner: waiting".to_owned())));
        assert_eq!(status_text(&packet(0, b"\x04x")), None);
        let beat = packet(HEARTBEAT, &[4, 0, 0, 0, 2, 3, 0xD9, 4, 3]);
        let (firmware, vehicle) = heartbeat(&beat).unwrap();
        assert_eq!(
            (firmware_name(firmware).as_str(), vehicle_name(vehicle).as_str()),
            ("ArduPilot", "a quadrotor")
        );
    }
}
