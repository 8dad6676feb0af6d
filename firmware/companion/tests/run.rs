//! `gleaner run` as a process.

mod fixture;

use fixture::vehicle::{FakeAutopilot, GLEANER, Process, Running};
use fixture::{Fixture, LOGITS};
use gleaner_link::{Message, TUNNEL_DECISION};
use gleaner_policy::LOCAL_MAP_CELLS;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, UdpSocket};
use std::process::{Command, Stdio};

#[test]
fn it_is_a_component_of_the_vehicle_until_interrupted() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    let (sender, heartbeat) = autopilot.until(|sender, message| match message {
        Message::Heartbeat(heartbeat) => Some((sender, *heartbeat)),
        _ => None,
    });
    assert_eq!(sender, GLEANER, "the autopilot's system id is adopted");
    assert_eq!((heartbeat.vehicle, heartbeat.autopilot), (18, 8));
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert!(rest.contains("stopped after 0 decisions: setpoints and heartbeat have ended"), "{rest}");
    assert!(!rest.contains("panicked"), "{rest}");
    assert!(rest.contains("autopilot port udpin:127.0.0.1:0: "), "the traffic is printed: {rest}");
    let farewell = autopilot.drain(|_, message| match message {
        Message::StatusText { text, .. } if text.starts_with(b"gleaner: stopped") => Some(()),
        _ => None,
    });
    assert!(farewell.is_some(), "the end is reported by a status text");
}

#[test]
fn every_decision_is_logged_whole() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.await_decision();
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    let text = std::fs::read_to_string(fixture.path("log/decisions.jsonl")).unwrap();
    let first: serde_json::Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    assert_eq!(first["state"], "shadow");
    assert_eq!(first["cell"], serde_json::json!([1, 0]));
    let mask = first["mask"].as_array().unwrap();
    assert!(mask.contains(&first["action"]) && mask[0] == "hover", "{first}");
    // Look-ahead is on by default; the first decision of a mission has the mission.
    let lookahead = &first["lookahead"];
    assert_eq!((&lookahead["budget"], &lookahead["slot"]), (&1000.into(), &0.into()), "{lookahead}");
    assert_eq!(lookahead["devices"].as_array().unwrap().len(), 1);
    assert_eq!(lookahead["mission"]["heights_m"].as_array().unwrap().len(), 12);
    assert_eq!(first["battery"], 20.0);
    assert_eq!(first["logits"], serde_json::json!(LOGITS));
    assert_eq!(first["w_data"], 0.25);
    // Spare battery, battery, terminal 2 cells east and 2 north.
    assert_eq!(first["tokens"]["uav"], serde_json::json!([16.0, 20.0, 40.0, 40.0]));
    assert_eq!(first["tokens"]["local_map"].as_array().unwrap().len(), LOCAL_MAP_CELLS);
    // One cell east and one north; a building hides it from the cell to the north, so the vantage is the one to the east.
    assert_eq!(first["tokens"]["devices"], serde_json::json!([[20.0, 20.0, 6000.0, -34.0, 0.0, 20.0, 0.0]]));
    assert_eq!(first["slots"], serde_json::json!([0]));
    assert!(first["infer_us"].is_u64() && first["run_s"].is_u64() && first["time_us"].is_u64(), "{first}");
}

#[test]
fn verbose_prints_one_line_for_each_decision() {
    let fixture = Fixture::new();
    let mut running = Running::start(fixture.gleaner("run").arg("-v"));
    FakeAutopilot::find(&mut running).await_decision();
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    let decisions = rest
        .lines()
        .filter(|line| line.contains("decision ") && line.contains(" at (1, 0), w 0.25, battery 20, spare "));
    let logged = std::fs::read_to_string(fixture.path("log/decisions.jsonl")).unwrap();
    assert_eq!(decisions.count(), logged.lines().count(), "{rest}");
}

#[test]
fn a_full_disk_is_reported_once_and_the_flight_goes_on() {
    let fixture = Fixture::new();
    std::fs::create_dir(fixture.path("log")).unwrap();
    std::os::unix::fs::symlink("/dev/full", fixture.path("log/decisions.jsonl")).unwrap();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.await_decision();
    autopilot.await_text("gleaner: decision log: disk full");
    autopilot.until(|_, message| match message {
        Message::Tunnel { payload_type: TUNNEL_DECISION, .. } => Some(()),
        _ => None,
    });
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert_eq!(rest.matches("make room on the disk; flying on without the log").count(), 1, "{rest}");
    assert!(rest.contains("records were not written"), "{rest}");
}

#[test]
fn a_blocked_or_closed_console_does_not_stop_the_flight() {
    for is_held in [false, true] {
        let fixture = Fixture::new();
        let (messages, stderr) = std::io::pipe().unwrap();
        let child = fixture.gleaner("run").env("RUST_LOG", "trace").stderr(stderr).spawn().unwrap();
        let mut process = Process::new(child);
        let mut messages = BufReader::new(messages);
        let mut line = String::new();
        while !line.contains("local address ") {
            line.clear();
            assert_ne!(messages.read_line(&mut line).unwrap(), 0, "the process ended");
        }
        let mut autopilot = FakeAutopilot::at(line.trim_end());
        let _held = if is_held {
            fill(messages.get_ref());
            Some(messages)
        } else {
            drop(messages);
            None
        };
        autopilot.await_decision();
        process.signal("TERM");
        assert_eq!(process.child.wait().unwrap().code(), Some(0), "held: {is_held}");
    }
}

/// Fills the pipe that ends here, so that one more byte would wait.
fn fill(pipe: &std::io::PipeReader) {
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::OpenOptionsExt;
    let nonblocking = rustix::fs::OFlags::NONBLOCK.bits() as i32;
    let mut options = std::fs::OpenOptions::new();
    options.write(true).custom_flags(nonblocking);
    let mut pipe = options.open(format!("/proc/self/fd/{}", pipe.as_raw_fd())).unwrap();
    while pipe.write(b".").is_ok() {}
}

#[test]
fn a_closed_terminal_ends_the_run_unless_hangups_are_ignored() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    FakeAutopilot::find(&mut running)
        .until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    let (code, rest) = running.stop_by("HUP");
    assert_eq!(code, Some(0), "{rest}");

    let gleaner = fixture.gleaner("run");
    let mut ignoring = Command::new("sh");
    ignoring
        .args(["-c", "trap '' HUP; exec \"$@\"", "sh"])
        .arg(gleaner.get_program())
        .args(gleaner.get_args());
    let mut running = Running::start(&mut ignoring);
    let mut autopilot = FakeAutopilot::find(&mut running);
    running.process.signal("HUP");
    autopilot.await_decision();
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert!(!rest.contains("stopped after 0 decisions"), "{rest}");
}

#[test]
fn a_lost_radio_is_reported_once_and_opened_again() {
    let fixture = Fixture::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let radio = format!("tcpout:{}", listener.local_addr().unwrap());
    let mut running = Running::start(fixture.gleaner("run").args(["--radio", &radio]));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    drop(listener.accept().unwrap());
    autopilot.await_text("gleaner: radio port down, retrying");
    let again = listener.accept().unwrap();
    autopilot.await_text("gleaner: radio port is back");
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert_eq!(rest.matches(&format!("radio port {radio} is down: ")).count(), 1, "{rest}");
    assert_eq!(rest.matches(&format!("radio port {radio} is back")).count(), 1, "{rest}");
    drop(again);
}

#[test]
fn check_hears_the_autopilot() {
    let fixture = Fixture::new();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let own = socket.local_addr().unwrap();
    // Frees the number for the process, which says when it listens.
    drop(socket);
    let mut child = fixture
        .gleaner("check")
        .args(["--wait", "30", "--autopilot", &format!("udpin:{own}")])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let stdout = BufReader::new(child.stdout.take().unwrap());
    let mut heard = None;
    for line in stdout.lines() {
        let line = line.unwrap();
        if line.starts_with("ok    autopilot") {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.connect(own).unwrap();
            FakeAutopilot::over(socket).send_state();
        }
        if line.contains("heartbeat") {
            heard = Some(line);
        }
    }
    assert_eq!(heard.as_deref(), Some("ok    heartbeat  ArduPilot, system id 7"));
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
