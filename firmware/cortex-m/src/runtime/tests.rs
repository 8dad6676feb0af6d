//! The main loop over doubles of its ports.

use super::*;
use core::convert::Infallible;
use embedded_io::ErrorType;
use gleaner_pilot::{ChannelAware, Decision, Mission, Parameters, Settings};
use gleaner_policy::{Inference, SelfTestError, Tokens};
use gleaner_units::{BatteryUnits, Cell, CellSet, Degrees, GeoPoint, Grid, GridPose, HeightMap, Metres};
use std::boxed::Box;
use std::cell::RefCell;
use std::rc::Rc;
use std::string::String;
use std::vec::Vec;

/// A line that delivers the same byte forever, or nothing, and accepts `room` bytes.
#[derive(Clone, Default)]
struct Line(Rc<RefCell<Wire>>);

#[derive(Default)]
struct Wire {
    floods: Option<u8>,
    taken: usize,
    room: usize,
    sent: Vec<u8>,
}

impl ErrorType for Line {
    type Error = Infallible;
}

impl ReadReady for Line {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.borrow().floods.is_some())
    }
}

impl Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut wire = self.0.borrow_mut();
        buffer.fill(wire.floods.expect("hardware would block: check readiness first"));
        wire.taken += buffer.len();
        Ok(buffer.len())
    }
}

impl WriteReady for Line {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.borrow().room > 0)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let mut wire = self.0.borrow_mut();
        assert!(wire.room > 0, "hardware would block: check readiness first");
        let count = bytes.len().min(wire.room);
        wire.room -= count;
        wire.sent.extend_from_slice(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

struct NoEngine;

impl Policy for NoEngine {
    type Error = ();
    fn infer(&mut self, _: &Tokens) -> Result<Inference, ()> {
        Err(())
    }
}

#[derive(Default)]
struct Notes {
    states: Vec<(State, State)>,
    losses: Vec<(String, PortStats)>,
}

impl EventLog for Notes {
    fn state(&mut self, from: State, to: State) {
        self.states.push((from, to));
    }
    fn decision(&mut self, _: &Decision, _: Option<Duration>) {}
    fn losses(&mut self, port: &'static str, stats: PortStats) {
        self.losses.push((port.into(), stats));
    }
}

fn runtime() -> (Runtime<'static, NoEngine, Line, Line>, Line, Line) {
    let grid = Grid::new(4, 3, Metres(20.0)).unwrap();
    let mission = Mission {
        heights: HeightMap::flat(grid),
        fence: CellSet::full(grid),
        pose: GridPose { corner: GeoPoint { lat_deg_e7: 0, lon_deg_e7: 0 }, rotation: Degrees(0.0) },
        terminal: Cell::new(3, 1),
        budget: BatteryUnits(80.0),
        devices: heapless::Vec::new(),
    };
    let engine = ChannelAware::new(Timed::new(NoEngine, || Instant::ZERO));
    let failed = Err(SelfTestError::NoGolden);
    let onboard = Onboard::new(mission, Parameters::default(), Settings::default(), engine, failed).unwrap();
    let (link, radio) = (Line::default(), Line::default());
    (Runtime::new(Box::leak(Box::new(onboard)), link.clone(), radio.clone()), link, radio)
}

/// Ids of the frames in `bytes`, all of which must be frames.
fn ids(mut bytes: &[u8]) -> Vec<u32> {
    let mut ids = Vec::new();
    while let [0xFD, length, _, _, _, _, _, id0, id1, id2, ..] = *bytes {
        ids.push(u32::from_le_bytes([id0, id1, id2, 0]));
        bytes = &bytes[12 + usize::from(length)..];
    }
    assert!(bytes.is_empty(), "half a frame");
    ids
}

#[test]
fn a_flood_on_both_lines_delays_no_poll() {
    for byte in [0x55, 0xFD] {
        let (mut runtime, link, radio) = runtime();
        for line in [&link, &radio] {
            line.0.borrow_mut().floods = Some(byte);
        }
        link.0.borrow_mut().room = usize::MAX;
        let (mut notes, mut polls) = (Notes::default(), 0);
        for milli in 0..10_000 {
            let before = [link.0.borrow().taken, radio.0.borrow().taken];
            polls +=
                usize::from(runtime.pass(Instant::from_millis(milli), [PortStats::default(); 2], &mut notes));
            let after = [link.0.borrow().taken, radio.0.borrow().taken];
            assert!(after[0] - before[0] <= BYTES_PER_PASS && after[1] - before[1] <= BYTES_PER_PASS);
        }
        assert_eq!(polls, 500, "every 20 ms");
        let heartbeats = ids(&link.0.borrow().sent).iter().filter(|&&id| id == 0).count();
        // Heartbeats start after 5 s without an autopilot.
        assert_eq!(heartbeats, 5, "with {byte:#x}");
        assert_eq!(notes.states, [(State::Boot, State::Fault)]);
    }
}

#[test]
fn a_slow_line_gets_complete_and_recent_frames() {
    let (mut runtime, link, _) = runtime();
    let mut notes = Notes::default();
    for milli in 0..12_000 {
        // 3 kB/s, and nothing for two seconds.
        link.0.borrow_mut().room = if (7_000..9_000).contains(&milli) { 0 } else { 3 };
        runtime.pass(Instant::from_millis(milli), [PortStats::default(); 2], &mut notes);
    }
    link.0.borrow_mut().room = usize::MAX;
    runtime.pass(Instant::from_millis(12_001), [PortStats::default(); 2], &mut notes);
    let heartbeats = ids(&link.0.borrow().sent).iter().filter(|&&id| id == 0).count();
    assert!((5..=7).contains(&heartbeats), "one a second except in the gap: {heartbeats}");
}

#[test]
fn losses_are_reported_at_most_every_ten_seconds() {
    let (mut runtime, link, _) = runtime();
    link.0.borrow_mut().room = usize::MAX;
    let mut notes = Notes::default();
    for milli in 0..25_000_u32 {
        let losses = PortStats { lost: milli / 100, damaged: 0 };
        runtime.pass(Instant::from_millis(milli.into()), [PortStats::default(), losses], &mut notes);
    }
    let reported: Vec<_> = notes.losses.iter().map(|(port, stats)| (port.as_str(), stats.lost)).collect();
    assert_eq!(reported, [("radio", 1), ("radio", 101), ("radio", 201)]);
}
