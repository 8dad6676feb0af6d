//! Listening for an autopilot without sending anything.

use gleaner_link::{Firmware, FrameDecoder, Message};
use gleaner_ports::{Port, RECEIVE_BYTES, State, wait};
use std::time::{Duration, Instant};

/// The first autopilot heard, or what was heard instead and what to do about it.
pub(super) fn autopilot(link: &mut Port, at_most: Duration) -> Result<String, String> {
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
                    return Ok(format!("{name}, system id {}", frame.sender.system));
                }
            }
        }
        let Some(left) = at_most.checked_sub(start.elapsed()) else {
            return Err(silence(link, u64::from(decoder.stats().frames)));
        };
        if bytes == 0 {
            // A wait that fails ends at once; the deadline still holds.
            let _ = wait(&[link], left.min(Duration::from_millis(200)));
        }
    }
}

fn silence(link: &Port, frames: u64) -> String {
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
