//! The state machine explored to a depth over an alphabet of events: the rules of authority hold on every path.
//!
//! Each path is a word over [`EVENTS`]. Machines are copied at each branch, so a word of length n costs one step of a
//! second, not n. A state that was reached before with as many events left is not explored again.

use crate::rig::Rig;
use gleaner_link::{AutopilotCommand, Firmware, FlightMode};
use gleaner_pilot::{Outputs, Request, State};
use gleaner_units::{Duration, Instant};
use std::collections::HashMap;

/// An event and what it does to the rig.
type Act = (&'static str, fn(&mut Rig));

/// What may happen, each followed by one second of polls.
const EVENTS: [Act; 16] = [
    ("nothing", |_| {}),
    ("engage", |rig| rig.request = Some(Request::Engage)),
    ("off", |rig| rig.request = Some(Request::Off)),
    ("return", |rig| rig.request = Some(Request::Return)),
    ("hand back", |rig| rig.request = Some(Request::HandBack)),
    ("guided", |rig| rig.vehicle.mode = Some(FlightMode::Guided)),
    ("hold", |rig| rig.vehicle.mode = Some(FlightMode::Hold)),
    ("brief hold", |rig| rig.other_mode_seen = true),
    ("downlink cut", |rig| rig.beats = false),
    ("downlink back", |rig| rig.beats = true),
    ("autopilot lost", |rig| rig.vehicle.mode = None),
    ("stall", |rig| rig.now = rig.now + Duration::from_secs(3)),
    ("foreign target", |rig| {
        rig.foreign_target |= rig.state().flies() || rig.machine.is_handing_back();
    }),
    ("estimator lost", |rig| rig.vehicle.ready = false),
    ("failsafe", |rig| rig.vehicle.failsafe = true),
    ("refuses", |rig| rig.accepts = Some(false)),
];
const DEPTH: usize = 5;

/// The evidence that the machine has: what the rules are judged by, kept apart from the machine.
#[derive(Clone, Copy)]
struct Judge {
    /// When the machine was last polled.
    polled_at: Instant,
    /// When something last happened that a command could answer, or a command left.
    reason_at: Instant,
    /// Heartbeats up to here may have waited in a queue.
    old_until: Instant,
    state: State,
    /// Whether the operator requested to engage since the pilot last gave up the aircraft.
    requested: bool,
}

impl Judge {
    fn judge(&mut self, rig: &Rig, out: &Outputs, other_mode: bool, word: &[usize]) {
        let path = || word.iter().map(|&event| EVENTS[event].0).collect::<Vec<_>>().join(", ");
        let vehicle = &rig.vehicle;
        let state = rig.state();
        if rig.now.since(self.polled_at) > Duration::from_secs(1) {
            self.old_until = rig.now + Duration::from_millis(500);
        }
        self.polled_at = rig.now;
        let entered = state != self.state;
        let beat = vehicle.heartbeat_at;
        let ours = vehicle.is_guided() && vehicle.armed && !other_mode;
        if let Some(command) = out.command {
            let fresh = beat.is_some_and(|at| at > self.reason_at && at > self.old_until);
            let moves = command != AutopilotCommand::Land || state == State::Homing;
            assert!(ours && fresh && moves, "{command:?} in {state:?} without evidence: {}", path());
            assert!(!rig.foreign_target, "{command:?} while another steers: {}", path());
            self.reason_at = rig.now;
        }
        if let Some(target) = out.setpoint {
            assert!(state.flies() || state == State::Waiting, "a target in {state:?}: {}", path());
            assert!(target.position.is_finite() && target.velocity.unwrap_or_default().is_finite());
            assert!(state == State::Waiting || !is_old(rig), "a target on old evidence: {}", path());
            let is_px4 = vehicle.firmware == Some(Firmware::Px4);
            assert!(!(is_px4 && vehicle.failsafe), "a target during a failsafe: {}", path());
            assert!(
                !state.flies() || (ours && !rig.foreign_target),
                "a target of a taken aircraft: {}",
                path()
            );
        }
        if entered && state == State::Engaged {
            assert!(self.requested, "engaged without a request: {}", path());
            assert!(beat.is_some_and(|at| at > self.old_until), "engaged on old evidence: {}", path());
        }
        if entered && self.state.flies() && !state.flies() {
            assert!(out.withdraw, "left {:?} with commands under way: {}", self.state, path());
            self.reason_at = rig.now;
        }
        if entered && !state.commands() {
            self.requested = false;
        }
        self.state = state;
    }
}

/// Whether the last heartbeat is older than a target may be sent on.
fn is_old(rig: &Rig) -> bool {
    rig.vehicle.heartbeat_at.is_none_or(|at| rig.now.since(at) > Duration::from_millis(2_500))
}

/// What distinguishes two machines as far as the rules go.
fn key(rig: &Rig) -> String {
    let (vehicle, machine) = (&rig.vehicle, &rig.machine);
    let age = |at: Option<Instant>| at.map(|at| rig.now.since(at).as_millis() / 100);
    format!(
        "{:?} {:?} {:?} {:?} {} {:?} {} {} {} {} {:?} {:?} {:?} {}",
        machine.state(),
        machine.fault(),
        machine.missing(),
        vehicle.mode,
        machine.is_handing_back(),
        age(vehicle.heartbeat_at),
        rig.beats,
        rig.foreign_target,
        vehicle.ready,
        vehicle.failsafe,
        rig.accepts,
        machine.target(),
        rig.ended,
        machine.landed(),
    )
}

struct Explorer {
    /// The events left when a state was explored.
    seen: HashMap<String, usize>,
    words: usize,
}

impl Explorer {
    fn explore(&mut self, rig: &Rig, judge: Judge, word: &mut Vec<usize>) {
        let left = DEPTH - word.len();
        if left == 0 || self.seen.get(&key(rig)).is_some_and(|&explored| explored >= left) {
            return;
        }
        self.seen.insert(key(rig), left);
        for (event, (_, happen)) in EVENTS.iter().enumerate() {
            let (mut rig, mut judge) = (rig.clone(), judge);
            word.push(event);
            self.words += 1;
            if event == 1 {
                judge.requested = true;
            }
            happen(&mut rig);
            for _ in 0..11 {
                let other_mode = rig.other_mode_seen || rig.vehicle.is_taken();
                let mode = rig.vehicle.mode;
                let out = rig.step_after(Duration::from_millis(100));
                // The aircraft's answer belongs to the next poll.
                let answered = std::mem::replace(&mut rig.vehicle.mode, mode);
                judge.judge(&rig, &out, other_mode, word);
                rig.vehicle.mode = answered;
            }
            self.explore(&rig, judge, word);
            word.pop();
        }
    }
}

/// Each step of the search holds a copy of the machine with its grid.
#[test]
fn the_rules_of_authority_hold_on_every_path() {
    let search = std::thread::Builder::new().stack_size(64 << 20).spawn(search_every_path).unwrap();
    search.join().unwrap();
}

fn search_every_path() {
    for firmware in [Firmware::ArduPilot, Firmware::Px4] {
        for engaged in [false, true] {
            let mut rig = Rig::new();
            rig.vehicle.firmware = Some(firmware);
            rig.run(1.0);
            if engaged {
                rig.engage();
            }
            let judge = Judge {
                polled_at: rig.now,
                reason_at: Instant::ZERO,
                old_until: Instant::ZERO,
                state: rig.state(),
                requested: false,
            };
            let mut explorer = Explorer { seen: HashMap::new(), words: 0 };
            explorer.explore(&rig, judge, &mut Vec::new());
            assert!(explorer.words > 1_000, "{} words", explorer.words);
            assert!(explorer.seen.len() > 100, "{} states", explorer.seen.len());
        }
    }
}
