//! A pilot behind byte streams: a board, an emulator or a companion computer.
//!
//! Such a pilot has its own clock, so the simulation follows the wall clock. The aircraft may be faster
//! ([`crate::MissionPlan::speedup`]): between two decisions it flies from rest to rest, so an earlier arrival changes
//! nothing for the pilot, and a mission of six minutes takes one and a half.

use crate::companion::Companion;
use crate::flight::{Ending, FlightResult, FlightRun};
use crate::pace::Pace;
use crate::simulation::Simulation;
use crate::wire::Speaker;
use gleaner_link::{Address, TUNNEL_RADIO_REPORT};
use gleaner_ports::{Port, RECEIVE_BYTES, State, wait};
use gleaner_radio::{Report, encode, encode_body};
use gleaner_units::Instant;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::TUNNEL_DATA;
use std::io;
use std::time::{self, Duration};

/// How long the pilot's port may be closed in flight, for a cable that is plugged in again.
const GONE_LIMIT: Duration = Duration::from_secs(5);
/// Reads per port and exchange: a flood on one port must not stop the simulation.
const READS_AT_ONCE: usize = 64;

/// A pilot on its own clock: a board, an emulator or a companion computer behind one port for the
/// autopilot's link and one for the radio's reports. Without the second, the reports come by `TUNNEL` on the first.
pub struct Wired {
    autopilot: Port,
    radio: Option<Port>,
    /// The radio as a component of the vehicle.
    modem: Speaker,
}

impl Wired {
    /// `MAV_COMP_ID_TELEMETRY_RADIO`.
    const MODEM: Address = Address::new(1, 68);

    /// A pilot behind these ports.
    #[must_use]
    pub const fn new(autopilot: Port, radio: Option<Port>) -> Wired {
        Wired { autopilot, radio, modem: Speaker::new(Wired::MODEM) }
    }

    /// The port of the autopilot's link.
    #[must_use]
    pub const fn autopilot(&self) -> &Port {
        &self.autopilot
    }

    /// The port of the radio's reports.
    #[must_use]
    pub const fn radio(&self) -> Option<&Port> {
        self.radio.as_ref()
    }

    /// Whether bytes can travel to and from the pilot.
    #[must_use]
    pub fn is_up(&self) -> bool {
        self.autopilot.state() == State::Up
    }

    /// Reopens closed ports; call it several times a second.
    pub fn maintain(&mut self, now: time::Instant) {
        // A closed port is no error here: `is_up` reports it.
        for port in [Some(&mut self.autopilot), self.radio.as_mut()].into_iter().flatten() {
            let _ = port.maintain(now);
        }
    }

    /// Waits for a pilot to connect; whether one has. Its first bytes are kept.
    ///
    /// # Errors
    /// The operating system cannot wait.
    pub fn await_peer(&mut self, at_most: Duration) -> io::Result<bool> {
        if !self.is_up() {
            wait(&[&self.autopilot], at_most)?;
            // An empty buffer takes nothing but the connection.
            self.autopilot.receive(&mut []);
        }
        Ok(self.is_up())
    }

    /// Noise on the lines to the pilot: bytes that neither autopilot nor radio has sent.
    pub fn disturb(&mut self, autopilot: &[u8], radio: &[u8]) {
        self.autopilot.send(autopilot);
        if let Some(port) = self.radio.as_mut() {
            port.send(radio);
        }
    }

    /// Sleeps until a port is readable or the time is over.
    pub fn rest(&self, at_most: Duration) {
        let ports: Vec<&Port> = [Some(&self.autopilot), self.radio()].into_iter().flatten().collect();
        if wait(&ports, at_most).is_err() {
            // The system cannot wait on the ports.
            std::thread::sleep(at_most);
        }
    }

    fn send_report(&mut self, report: &Report) {
        match &mut self.radio {
            Some(radio) => radio.send(&encode(report)),
            None => {
                // By hand: the definitions do not list types for local use.
                let body = encode_body(report);
                let [low, high] = TUNNEL_RADIO_REPORT.to_le_bytes();
                let mut payload = vec![low, high, 0, 0, body.len() as u8];
                payload.extend_from_slice(&body);
                self.autopilot.send(&self.modem.raw_frame(TUNNEL_DATA::ID, &payload));
            }
        }
    }
}

impl Companion for Wired {
    fn exchange(&mut self, simulation: &mut Simulation, now: Instant) {
        receive(&mut self.autopilot, |bytes| simulation.from_companion(bytes));
        if let Some(radio) = &mut self.radio {
            // The radio port receives nothing, but a listening port must look for its peer.
            receive(radio, |_| {});
        }
        for frame in simulation.to_companion() {
            simulation.delivered(now, &frame);
            self.autopilot.send(&frame);
        }
        for report in simulation.radio() {
            self.send_report(&report);
        }
    }
}

/// Reads the available bytes.
pub(crate) fn receive(port: &mut Port, mut take: impl FnMut(&[u8])) {
    let mut buffer = [0; RECEIVE_BYTES];
    for _ in 0..READS_AT_ONCE {
        match port.receive(&mut buffer) {
            0 => break,
            count => take(&buffer[..count]),
        }
    }
}

/// Flies a mission on the wall clock, from boot to landing. `watch` runs before each step; an ending that it returns
/// ends the flight.
pub fn fly_wired(
    mut flight: FlightRun,
    wired: &mut Wired,
    mut watch: impl FnMut(&FlightRun, &mut Wired) -> Option<Ending>,
) -> FlightResult {
    let mut pace = Pace::new(flight.simulation().setup().plan.speedup);
    let mut up_at = time::Instant::now();
    loop {
        for _ in 0..pace.due() {
            if let Some(ending) = watch(&flight, wired).or_else(|| flight.step(wired)) {
                return flight.end(ending, None);
            }
        }
        wired.maintain(time::Instant::now());
        if wired.is_up() {
            up_at = time::Instant::now();
        } else if up_at.elapsed() > GONE_LIMIT {
            return flight.end(Ending::PilotGone, None);
        }
        wired.rest(pace.rest());
    }
}
