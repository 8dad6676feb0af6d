//! Listening on the ports of autopilot and radio without sending anything.

use crate::config::RadioFormat;
use crate::radio::{Radio, describe};
use gleaner_link::{Firmware, FrameDecoder, Message};
use gleaner_ports::{Port, RECEIVE_BYTES, State, wait};
use gleaner_radio::Likely;
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// A ground station's heartbeat comes once a second: after the autopilot's it is waited for this long.
const LINGER: Duration = Duration::from_secs(2);
/// `MAV_TYPE_GCS` of the MAVLink common message set.
const GROUND_STATION: u8 = 6;

/// What arrived on the ports.
#[derive(Default)]
pub(super) struct Heard {
    autopilot: Option<(Firmware, u8)>,
    /// Whether a ground station was heard through the autopilot.
    station: bool,
    frames: u32,
    devices: BTreeSet<u32>,
    /// The first bytes of the radio.
    radio_bytes: Vec<u8>,
}

impl Heard {
    /// Listens on both ports for at most `at_most`.
    pub fn listen(link: &mut Port, mut radio: Option<&mut Radio>, at_most: Duration) -> Heard {
        let start = Instant::now();
        let mut heard = Heard::default();
        let mut found_at = None;
        let mut decoder = FrameDecoder::new();
        let mut buffer = [0; RECEIVE_BYTES];
        loop {
            link.maintain(Instant::now());
            let bytes = link.receive(&mut buffer);
            heard.read_link(&mut decoder, &buffer[..bytes]);
            let radio_bytes = radio.as_deref_mut().map_or(0, |radio| heard.read_radio(radio, &mut buffer));
            if heard.autopilot.is_some() {
                found_at = found_at.or(Some(Instant::now()));
            }
            let complete = heard.station && (radio.is_none() || !heard.devices.is_empty());
            let lingered = |at: Instant| complete || at.elapsed() >= LINGER;
            let left = at_most.checked_sub(start.elapsed());
            let Some(left) = left.filter(|_| !found_at.is_some_and(lingered)) else { return heard };
            if bytes == 0 && radio_bytes == 0 {
                let ports: Vec<&Port> =
                    [&*link].into_iter().chain(radio.as_deref().map(Radio::port)).collect();
                // A wait that fails ends at once; the deadline still holds.
                let _ = wait(&ports, left.min(Duration::from_millis(200)));
            }
        }
    }

    fn read_link(&mut self, decoder: &mut FrameDecoder, mut bytes: &[u8]) {
        while let Some(frame) = decoder.read(&mut bytes) {
            let Ok(Some(Message::Heartbeat(heartbeat))) = Message::decode(&frame) else { continue };
            let firmware = Firmware::from_wire(heartbeat.autopilot);
            if firmware_name(firmware).is_some() {
                self.autopilot.get_or_insert((firmware, frame.sender.system));
            }
            self.station |= heartbeat.vehicle == GROUND_STATION;
        }
        self.frames = decoder.stats().frames;
    }

    fn read_radio(&mut self, radio: &mut Radio, buffer: &mut [u8]) -> usize {
        radio.maintain(Instant::now());
        let bytes = radio.receive(buffer, |report| {
            self.devices.insert(report.device);
        });
        if self.radio_bytes.is_empty() {
            self.radio_bytes.extend_from_slice(bytes);
        }
        bytes.len()
    }

    /// The autopilot, or what was heard instead and what to do about it.
    pub fn autopilot(&self, link: &Port) -> Result<String, String> {
        match self.autopilot {
            Some((firmware, system)) => {
                let name = firmware_name(firmware).unwrap_or("autopilot");
                Ok(format!("{name}, system id {system}"))
            }
            None => Err(silence(link, self.frames)),
        }
    }

    /// What to do when no ground station is heard through the autopilot.
    pub fn no_station(&self) -> Option<&'static str> {
        let (firmware, _) = self.autopilot.filter(|_| !self.station)?;
        Some(match firmware {
            Firmware::Px4 => {
                "none heard through the autopilot: connect it, and set MAV_0_FORWARD and MAV_1_FORWARD to 1"
            }
            _ => "none heard through the autopilot: connect it there, or to a `ground` port",
        })
    }

    /// What the autopilot does when this program dies, where the operator should change that. Its parameters are not
    /// read: listening sends nothing.
    pub fn dead_companion(&self) -> Option<&'static str> {
        let (firmware, _) = self.autopilot?;
        (firmware == Firmware::ArduPilot).then_some(
            "not read: if this program dies, ArduPilot flies on for GUID_TIMEOUT (default 3 s): set it to 1",
        )
    }

    /// What the radio sent, or what is wrong with it and what to do. `known`: the devices of the mission.
    pub fn radio(&self, radio: &Radio, format: RadioFormat, known: &[u32]) -> Result<String, String> {
        let stats = radio.stats();
        let counts = describe(&stats);
        if let State::Down(reason) = radio.port().state() {
            return Err(format!("{reason}: no report"));
        }
        if stats.bytes == 0 {
            return Err("no byte received: check wiring, and that the radio is on".into());
        }
        if stats.reports == 0 {
            return Err(format!("{counts}: {}", advice(Likely::of(&self.radio_bytes), format)));
        }
        let strange: Vec<String> =
            self.devices.iter().filter(|device| !known.contains(device)).map(u32::to_string).collect();
        if !strange.is_empty() && !known.is_empty() {
            return Err(format!("{counts}; not in the mission: {}: correct the ids", strange.join(", ")));
        }
        Ok(format!("{counts} of {} devices", self.devices.len()))
    }
}

/// What to do about bytes that are no reports.
fn advice(likely: Likely, format: RadioFormat) -> String {
    let right = match likely {
        Likely::Json if !matches!(format, RadioFormat::JsonLines(_)) => "json_lines",
        Likely::Semtech if !matches!(format, RadioFormat::SemtechUdp(_)) => "semtech_udp",
        // The format is right, and something else is not.
        Likely::Json | Likely::Semtech => return "see docs/radio.md for what a report needs".into(),
        Likely::MavLink => return "MAVLink belongs on the autopilot's port".into(),
        Likely::Unknown => return "wrong radio_format or baud rate?".into(),
        other => return format!("{other}; a modem must send reports, see docs/radio.md"),
    };
    format!("{likely}; write radio_format = \"{right}\"")
}

fn silence(link: &Port, frames: u32) -> String {
    match (link.state(), link.stats().bytes_in, frames) {
        (State::Down(reason), _, _) => format!("{reason}: no autopilot heard"),
        (State::Up, 0, _) => {
            "no byte received: check wiring, and that the autopilot sends MAVLink on this port".into()
        }
        (State::Up, bytes, 0) => format!("{bytes} bytes but no MAVLink: check the baud rate"),
        (State::Up, _, frames) => format!("{frames} MAVLink packets but no heartbeat of an ArduPilot or PX4"),
    }
}

fn firmware_name(firmware: Firmware) -> Option<&'static str> {
    match firmware {
        Firmware::ArduPilot => Some("ArduPilot"),
        Firmware::Px4 => Some("PX4"),
        Firmware::Other(_) => None,
    }
}
