//! How a run ends, what it leaves to the next one, and what it does after it was stopped for a while.

mod fixture;

use fixture::vehicle::{FakeAutopilot, Running};
use fixture::{Fixture, outcome};
use gleaner_link::Message;
use mavlink::dialects::ardupilotmega::*;
use std::collections::BTreeSet;
use std::os::unix::net::UnixDatagram;
use std::time::Duration;

/// ArduCopter's LOITER.
const LOITER: u32 = 5;
/// `MAV_CMD_NAV_RETURN_TO_LAUNCH` and `MAV_CMD_DO_SET_MODE`: the two ways to request a return.
const RETURNS: [u16; 2] = [20, 176];

fn run_with_state(fixture: &Fixture) -> std::process::Command {
    let mut gleaner = fixture.gleaner("run");
    gleaner.arg("--state").arg(fixture.path("state"));
    gleaner
}

fn is_return(message: &Message) -> bool {
    matches!(message, Message::Command(command) if RETURNS.contains(&command.id))
}

#[test]
fn sigterm_in_flight_hands_the_aircraft_back() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.engage();
    running.process.signal("TERM");
    autopilot.until(|_, message| is_return(message).then_some(()));
    autopilot.await_text("gleaner: stopped in flight, take over now");
    // The operator's LOITER ends the request at once.
    autopilot.custom_mode = LOITER;
    autopilot.send_state();
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert!(rest.contains("stopped in flight, take over now"), "{rest}");
}

#[test]
fn a_killed_run_is_reported_by_the_next_one() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut run_with_state(&fixture));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.engage();
    running.says("-> engaged");
    let note = fixture.path("state/last_run.toml");
    // A thread writes the note, when the disk permits.
    let noted = || std::fs::read_to_string(&note).is_ok_and(|text| text.contains("engaged"));
    autopilot.until(|_, _| noted().then_some(()));
    let (code, _) = running.stop_by("KILL");
    assert_eq!(code, None);

    let mut running = Running::start(&mut run_with_state(&fixture));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.await_text("gleaner: last run was cut off while engaged");
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");

    let mut running = Running::start(&mut run_with_state(&fixture));
    FakeAutopilot::find(&mut running)
        .until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    let (_, rest) = running.stop();
    assert!(!rest.contains("last run"), "the second run ended as asked: {rest}");
}

#[test]
fn parameters_set_from_the_ground_are_kept_until_reset() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut run_with_state(&fixture));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    let mut set = PARAM_SET_DATA {
        target_system: 7,
        target_component: 191,
        param_value: 75.0,
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        ..PARAM_SET_DATA::DEFAULT
    };
    set.param_id = "GLN_ALT".into();
    autopilot.send_from_ground(&set);
    autopilot.drain(|_, _| None::<()>);
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");

    let mut running = Running::start(&mut run_with_state(&fixture));
    running.says("GLN_ALT = 75, set from the ground; the configuration has 60");
    running.stop();
    let mut running = Running::start(run_with_state(&fixture).arg("--reset-parameters"));
    FakeAutopilot::find(&mut running)
        .until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    let (_, rest) = running.stop();
    assert!(!rest.contains("GLN_ALT") && !fixture.path("state/parameters.toml").exists(), "{rest}");
}

#[test]
fn a_state_folder_that_cannot_be_used_is_one_line() {
    let fixture = Fixture::new();
    fixture.write("state", "a file, not a folder");
    let (code, _, stderr) = outcome(&run_with_state(&fixture).output().unwrap());
    assert_eq!((code, stderr.lines().count()), (Some(2), 1), "{stderr}");
    assert!(stderr.contains("give another folder with --state"), "{stderr}");
}

/// A process that was stopped wakes up to a full queue, of which the oldest messages are from before a take-over.
#[test]
fn a_stopped_process_commands_nothing_after_a_take_over() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.engage();
    running.process.signal("STOP");
    autopilot.send_state();
    for _ in 0..50 {
        autopilot.send_state();
    }
    autopilot.custom_mode = LOITER;
    autopilot.send_state();
    // Longer than the pilot accepts between two polls: nothing arrives until the time-out.
    autopilot.socket.set_read_timeout(Some(Duration::from_millis(1_500))).unwrap();
    autopilot.drain(|_, _| None::<()>);
    autopilot.socket.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    running.process.signal("CONT");
    let moved = (0..20).find_map(|_| {
        autopilot.send_state();
        autopilot.drain(|_, message| is_return(message).then_some(()))
    });
    assert_eq!(moved, None, "a return was requested while the pilot had the aircraft");
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
}

#[test]
fn the_decision_loop_feeds_systemds_watchdog() {
    let fixture = Fixture::new();
    let socket = UnixDatagram::bind(fixture.path("notify")).unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let mut gleaner = fixture.gleaner("run");
    gleaner.env("NOTIFY_SOCKET", fixture.path("notify")).env("WATCHDOG_USEC", "2000000");
    let running = Running::start(&mut gleaner);
    let next = || {
        let mut buffer = [0; 256];
        let bytes = socket.recv(&mut buffer).unwrap();
        String::from_utf8_lossy(&buffer[..bytes]).trim_end().to_owned()
    };
    assert_eq!(next(), "READY=1");
    let mut fed = 0;
    while fed < 2 {
        fed += usize::from(next() == "WATCHDOG=1");
    }
    running.process.signal("TERM");
    while next() != "STOPPING=1" {}
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
}

#[test]
fn a_ground_station_on_its_own_port_is_served() {
    let fixture = Fixture::new();
    let mut gleaner = fixture.gleaner("run");
    gleaner.args(["--ground", "udpin:127.0.0.1:0", "-v"]);
    let mut running = Running::start(&mut gleaner);
    let mut autopilot = FakeAutopilot::find(&mut running);
    let line = running.says("ground port udpin:127.0.0.1:0 is open, local address ");
    let mut ground = FakeAutopilot::at(&line);
    autopilot.until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    ground.hello();
    // The autopilot's heartbeats are forwarded, and ours arrive as well.
    let mut senders = BTreeSet::new();
    let _ = (0..100).find_map(|_| {
        autopilot.send_state();
        ground.drain(|sender, message| {
            senders.extend(matches!(message, Message::Heartbeat(_)).then_some(sender.component));
            (senders.len() == 2).then_some(())
        })
    });
    assert_eq!(senders, BTreeSet::from([1, 191]));
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert!(rest.contains("ground port udpin:127.0.0.1:0: 1 packets in"), "{rest}");
    assert!(rest.contains("serving ArduPilot on a quadrotor, system 7, as component 191"), "{rest}");
}
