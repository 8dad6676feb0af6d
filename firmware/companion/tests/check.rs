//! `gleaner check`: one finding a line, and the verdict in the exit code.

mod fixture;

use fixture::{Fixture, model, outcome};
use gleaner_link::{Address, Packet};
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavAutopilot, MavType};
use std::io::Write;
use std::net::{TcpListener, UdpSocket};
use std::process::Stdio;

/// `gleaner check` that does not listen for an autopilot.
fn check(fixture: &Fixture) -> std::process::Command {
    let mut gleaner = fixture.gleaner("check");
    gleaner.args(["--wait", "0"]);
    gleaner
}

#[test]
fn a_good_set_up_is_ready() {
    let fixture = Fixture::new();
    let (code, stdout, stderr) = outcome(&check(&fixture).output().unwrap());
    assert_eq!((code, stderr.as_str()), (Some(0), ""), "{stdout}");
    let whats: Vec<&str> =
        stdout.lines().map(|line| line.split_whitespace().take(2).last().unwrap()).collect();
    let expected = [
        "config",
        "mission",
        "way",
        "battery",
        "altitude",
        "grid",
        "battery",
        "model",
        "engine",
        "self-test",
        "inference",
        "autopilot",
        "log",
        "autopilot",
    ];
    assert_eq!(whats, expected, "{stdout}");
    assert!(stdout.ends_with("ready, autopilot not listened for, 2 warnings\n"), "{stdout}");
    assert!(!stdout.contains("FAIL"), "{stdout}");
    assert!(stdout.contains("1 devices with 6000 data units") && stdout.contains("hover"), "{stdout}");
}

#[test]
fn every_fault_is_printed() {
    let fixture = Fixture::new();
    fixture.write("policy.onnx", model([9.0; 5]));
    fixture.write("occupied", "a file, not a folder");
    fixture.edit("gleaner.toml", "\"log\"", "\"occupied\"");
    fixture.edit("gleaner.toml", "GLN_W_DATA = 0.25", "GLN_ALT = 30\nGLN_BAT_UNITS = 10\nGLN_RESERVE = 30");
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut gleaner = check(&fixture);
    gleaner.args(["--autopilot", &format!("udpin:{}", taken.local_addr().unwrap())]);
    let (code, stdout, stderr) = outcome(&gleaner.output().unwrap());
    assert_eq!((code, stderr.as_str()), (Some(1), ""), "{stdout}");
    let lines: Vec<&str> = stdout.lines().collect();
    for (start, end) in [
        ("ok    mission", "terminal (3, 2)"),
        ("FAIL  way home   20 battery units do not cover", "raise battery_units or lower GLN_RESERVE"),
        ("FAIL  battery    the mission takes 20 units", "lower battery_units or correct GLN_BAT_UNITS"),
        ("FAIL  altitude   30 m is not above the highest roof of 33 m", "raise GLN_ALT"),
        ("FAIL  model", "export the model again, or report this machine"),
        ("FAIL  autopilot", "or choose another number"),
        ("FAIL  log", "or correct its permissions"),
        ("not ready", "6 faults, 3 warnings"),
    ] {
        assert!(lines.iter().any(|line| line.starts_with(start) && line.ends_with(end)), "{start}: {stdout}");
    }
}

#[test]
fn a_fence_that_cuts_cells_off_is_a_fault() {
    let fixture = Fixture::new();
    fixture.edit("mission.toml", "[[device]]", "[fence]\nexcluded = [[1, 0], [1, 1], [1, 2]]\n\n[[device]]");
    let (code, stdout, _) = outcome(&check(&fixture).output().unwrap());
    assert_eq!(code, Some(1));
    assert!(stdout.contains("FAIL  way home   3 cells inside the fence are cut off"), "{stdout}");
}

#[test]
fn an_unreadable_configuration_ends_the_check() {
    let fixture = Fixture::new();
    fixture.edit("gleaner.toml", "model", "modle");
    let (code, stdout, stderr) = outcome(&fixture.gleaner("check").output().unwrap());
    assert_eq!((code, stdout.as_str(), stderr.lines().count()), (Some(2), "", 1));
}

#[test]
fn the_example_files_are_good_as_they_are() {
    let dist = concat!(env!("CARGO_MANIFEST_DIR"), "/dist/gleaner.toml");
    let mut gleaner = std::process::Command::new(env!("CARGO_BIN_EXE_gleaner"));
    gleaner.args(["check", "--wait", "0", "--config", dist]);
    // Other tests must be able to run at the same time.
    gleaner.args(["--autopilot", "udpin:127.0.0.1:0", "--radio", "udpin:127.0.0.1:0"]);
    let (code, stdout, stderr) = outcome(&gleaner.output().unwrap());
    assert_eq!((code, stderr.as_str()), (Some(0), ""), "{stdout}");
    assert!(stdout.contains("40 x 30 cells of 20 m, 1200 inside the fence, 6 devices"), "{stdout}");
    assert!(stdout.contains("(built-in)"), "{stdout}");
    assert!(!stdout.contains("warn"), "{stdout}");
}

#[test]
fn an_autopilot_that_is_not_heard_makes_the_verdict() {
    let fixture = Fixture::new();
    let (code, stdout, _) = outcome(&fixture.gleaner("check").args(["--wait", "1"]).output().unwrap());
    assert_eq!(code, Some(1), "{stdout}");
    assert!(stdout.contains("warn  heartbeat  no byte received: check wiring"), "{stdout}");
    assert!(stdout.contains("ready, but no autopilot was heard, "), "{stdout}");
}

/// ArduPilot moves its last target on for some seconds after this program has died; PX4 does not.
#[test]
fn guid_timeout_is_named_where_an_ardupilot_is_heard() {
    let autopilots =
        [(MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, true), (MavAutopilot::MAV_AUTOPILOT_PX4, false)];
    for (autopilot, is_named) in autopilots {
        let fixture = Fixture::new();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcpout:{}", listener.local_addr().unwrap());
        let mut gleaner = fixture.gleaner("check");
        let checks =
            gleaner.args(["--wait", "2", "--autopilot", &port]).stdout(Stdio::piped()).spawn().unwrap();
        let (mut line, _) = listener.accept().unwrap();
        let heartbeat =
            HEARTBEAT_DATA { mavtype: MavType::MAV_TYPE_QUADROTOR, autopilot, ..HEARTBEAT_DATA::DEFAULT };
        line.write_all(&Packet::new(&heartbeat).unwrap().frame(Address::new(7, 1), 0)).unwrap();
        let (code, stdout, _) = outcome(&checks.wait_with_output().unwrap());
        assert_eq!(code, Some(0), "{stdout}");
        assert_eq!(stdout.contains("ArduPilot flies on for GUID_TIMEOUT"), is_named, "{stdout}");
    }
}

/// The findings for the fixture's mission with one replacement.
fn findings(from: &str, to: &str) -> (Option<i32>, String) {
    let fixture = Fixture::new();
    fixture.edit("mission.toml", from, to);
    let (code, stdout, _) = outcome(&check(&fixture).output().unwrap());
    (code, stdout)
}

#[test]
fn a_cell_size_outside_the_training_is_a_warning() {
    for cell_m in ["1.0", "5.0", "50.0", "100.0"] {
        let (code, stdout) = findings("cell_m = 20.0", &format!("cell_m = {cell_m}"));
        assert_eq!(code, Some(0), "{stdout}");
        let number = cell_m.trim_end_matches(".0");
        let line = format!("warn  cell size  {number} m: the policy was trained at 20 m");
        assert!(stdout.contains(&line), "{stdout}");
    }
}

#[test]
fn many_devices_are_a_warning_and_too_many_a_fault() {
    let devices = |count: usize| -> String {
        (10..10 + count - 1)
            .map(|id| format!("[[device]]\nid = {id}\ncell = [0, 0]\ndata = 1.0\n\n"))
            .collect()
    };
    for (count, expected) in
        [(12, None), (13, Some("13: the policy sees 12 at a time")), (64, Some("64: the policy"))]
    {
        let (code, stdout) = findings("[[device]]", &format!("{}[[device]]", devices(count)));
        assert_eq!(code, Some(0), "{stdout}");
        assert_eq!(stdout.contains("warn  devices"), expected.is_some(), "{stdout}");
        assert!(stdout.contains(expected.unwrap_or("")), "{stdout}");
    }
    let (code, stdout) = findings("[[device]]", &format!("{}[[device]]", devices(65)));
    assert_eq!(code, Some(1), "{stdout}");
    assert!(stdout.contains("more than 64 devices"), "{stdout}");
}

#[test]
fn a_terminal_on_a_roof_is_a_fault_and_a_device_a_warning() {
    let (code, stdout) = findings("terminal = [3, 2]", "terminal = [1, 1]");
    assert_eq!(code, Some(1), "{stdout}");
    assert!(stdout.contains("line 1: the terminal (1, 1) is on a building of 33 m"), "{stdout}");
    let (code, stdout) = findings("terminal = [3, 2]", "terminal = [1, 1]\nterminal_height_m = 33");
    assert_eq!(code, Some(0), "{stdout}");
    assert!(stdout.contains("warn  terminal   (1, 1) is on a building of 33 m"), "{stdout}");
    let (code, stdout) = findings("cell = [2, 1]", "cell = [1, 1]");
    assert_eq!(code, Some(0), "{stdout}");
    assert!(stdout.contains("warn  device     device 1 at (1, 1) is on a building of 33 m"), "{stdout}");
}

#[test]
fn a_device_outside_the_fence_is_a_warning() {
    let (code, stdout) = findings("[[device]]", "[fence]\nexcluded = [[2, 1]]\n\n[[device]]");
    assert_eq!(code, Some(0), "{stdout}");
    assert!(stdout.contains("warn  fence      device 1 at (2, 1) is outside the fence"), "{stdout}");
}

#[test]
fn a_mission_that_leaves_nothing_for_the_landing_is_a_warning() {
    let fixture = Fixture::new();
    fixture.edit("gleaner.toml", "GLN_W_DATA = 0.25", "GLN_BAT_UNITS = 22");
    let (code, stdout, _) = outcome(&check(&fixture).output().unwrap());
    assert_eq!(code, Some(0), "{stdout}");
    assert!(stdout.contains("warn  battery    9 % may not cover the landing"), "{stdout}");
}

#[test]
fn files_from_windows_are_read_and_utf16_is_named() {
    let fixture = Fixture::new();
    let windows = |text: &str| format!("\u{feff}{}", text.replace('\n', "\r\n"));
    for name in ["gleaner.toml", "mission.toml", "city.csv"] {
        let text = std::fs::read_to_string(fixture.path(name)).unwrap();
        fixture.write(name, windows(&text));
    }
    let (code, stdout, _) = outcome(&check(&fixture).output().unwrap());
    assert_eq!(code, Some(0), "{stdout}");
    let utf16 = |text: &str| -> Vec<u8> { text.encode_utf16().flat_map(u16::to_le_bytes).collect() };
    fixture.write("mission.toml", utf16("\u{feff}terminal = [3, 2]"));
    let (code, stdout, _) = outcome(&check(&fixture).output().unwrap());
    assert_eq!(code, Some(1), "{stdout}");
    assert!(stdout.contains("mission.toml: the file is UTF-16: save as UTF-8"), "{stdout}");
    fixture.write("gleaner.toml", utf16("\u{feff}mission = \"mission.toml\""));
    let (code, _, stderr) = outcome(&check(&fixture).output().unwrap());
    assert_eq!((code, stderr.lines().count()), (Some(2), 1), "{stderr}");
    assert!(stderr.contains("gleaner.toml: the file is UTF-16: save as UTF-8"), "{stderr}");
}
