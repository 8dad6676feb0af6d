//! `gleaner check`: every finding on its line, and the verdict in the exit code.

mod fixture;

use fixture::{Fixture, model, outcome};
use std::net::UdpSocket;

#[test]
fn a_good_set_up_is_ready() {
    let fixture = Fixture::new();
    let (code, stdout, stderr) = outcome(&fixture.gleaner("check").output().unwrap());
    assert_eq!((code, stderr.as_str()), (Some(0), ""), "{stdout}");
    let whats: Vec<&str> =
        stdout.lines().map(|line| line.split_whitespace().take(2).last().unwrap()).collect();
    let expected = [
        "config",
        "mission",
        "way",
        "battery",
        "altitude",
        "model",
        "engine",
        "self-test",
        "inference",
        "autopilot",
        "log",
        "ready",
    ];
    assert_eq!(whats, expected, "{stdout}");
    assert!(stdout.lines().all(|line| line.starts_with("ok    ") || line == "ready"), "{stdout}");
    assert!(stdout.contains("1 devices with 6000 data units") && stdout.contains("hover"), "{stdout}");
}

#[test]
fn every_fault_is_told_not_only_the_first() {
    let fixture = Fixture::new();
    fixture.write("policy.onnx", model([9.0; 5]));
    fixture.write("occupied", "a file, not a folder");
    fixture.edit("gleaner.toml", "\"log\"", "\"occupied\"");
    fixture.edit("gleaner.toml", "GLN_W_DATA = 0.25", "GLN_ALT = 30\nGLN_BAT_UNITS = 10\nGLN_RESERVE = 30");
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut gleaner = fixture.gleaner("check");
    gleaner.args(["--autopilot", &format!("udpin:{}", taken.local_addr().unwrap())]);
    let (code, stdout, stderr) = outcome(&gleaner.output().unwrap());
    assert_eq!((code, stderr.as_str()), (Some(1), ""), "{stdout}");
    let lines: Vec<&str> = stdout.lines().collect();
    for (start, end) in [
        ("ok    mission", "terminal (3, 2)"),
        ("FAIL  way home   20 battery units do not cover", "raise battery_units or lower GLN_RESERVE"),
        ("FAIL  battery    the mission wants 20 units", "lower battery_units or correct GLN_BAT_UNITS"),
        ("FAIL  altitude   30 m is not above the tallest building of 33 m", "raise GLN_ALT"),
        ("FAIL  model", "export the model again, or report this machine"),
        ("FAIL  autopilot", "or choose another number"),
        ("FAIL  log", "or its permissions"),
        ("not ready", "6 faults"),
    ] {
        assert!(lines.iter().any(|line| line.starts_with(start) && line.ends_with(end)), "{start}: {stdout}");
    }
}

#[test]
fn a_fence_that_cuts_cells_off_is_a_fault() {
    let fixture = Fixture::new();
    fixture.edit("mission.toml", "[[device]]", "[fence]\nexcluded = [[1, 0], [1, 1], [1, 2]]\n\n[[device]]");
    let (code, stdout, _) = outcome(&fixture.gleaner("check").output().unwrap());
    assert_eq!(code, Some(1));
    assert!(stdout.contains("FAIL  way home   3 cells inside the fence are cut off"), "{stdout}");
}

#[test]
fn a_configuration_that_cannot_be_read_leaves_nothing_to_check() {
    let fixture = Fixture::new();
    fixture.edit("gleaner.toml", "model", "modle");
    let (code, stdout, stderr) = outcome(&fixture.gleaner("check").output().unwrap());
    assert_eq!((code, stdout.as_str(), stderr.lines().count()), (Some(2), "", 1));
}

#[test]
fn the_example_files_are_consistent() {
    let dist = concat!(env!("CARGO_MANIFEST_DIR"), "/dist/gleaner.toml");
    let fixture = Fixture::new();
    let mut gleaner = std::process::Command::new(env!("CARGO_BIN_EXE_gleaner"));
    gleaner.args([
        "check",
        "--config",
        dist,
        "--autopilot",
        "udpin:127.0.0.1:0",
        "--radio",
        "udp:127.0.0.1:0",
    ]);
    gleaner.arg("--model").arg(fixture.path("policy.onnx")).arg("--log").arg(fixture.path("log"));
    let (code, stdout, stderr) = outcome(&gleaner.output().unwrap());
    assert_eq!((code, stderr.as_str()), (Some(0), ""), "{stdout}");
    assert!(stdout.contains("40 x 30 cells of 20 m, 1200 inside the fence, 6 devices"), "{stdout}");
}
