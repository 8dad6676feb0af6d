//! The program `gleaner-sitl` as a user runs it: exit codes, one-line errors, ports, files.

use gleaner_pilot::mission_file;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gleaner-sitl"));
    command.stdin(Stdio::null());
    command
}

fn said(output: &Output) -> (Option<i32>, String) {
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn errors_are_one_line_and_exit_code_2() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.onnx");
    std::fs::write(&broken, b"this is no model").unwrap();
    let broken = broken.to_str().unwrap();
    let cases: [(&[&str], &str); 7] = [
        (&["fly", "--model", "/no/such/model.onnx"], "there is no model at /no/such/model.onnx: train one"),
        (&["fly", "--model", broken], "is unfit to fly"),
        (&["fly", "--preference", "1.5"], "a weight is a number from 0 to 1"),
        (&["fly", "--switch", "soon:0.5"], "the time is a number of seconds"),
        (&["hover"], "unrecognized subcommand 'hover'"),
        (&["serve", "--gcs", "pigeon:1:2"], "is not an endpoint"),
        (&["serve", "--battery", "450"], "ask for 400 at most"),
    ];
    for (words, cause) in cases {
        let (code, error) = said(&program().args(words).output().unwrap());
        assert_eq!(code, Some(2), "{words:?}: {error}");
        assert!(error.starts_with("gleaner-sitl: ") && error.contains(cause), "{words:?}: {error}");
        assert_eq!(error.trim_end().lines().count(), 1, "{error}");
    }
}

#[test]
fn a_sweep_reports_the_same_twice() {
    let folder = tempfile::tempdir().unwrap();
    let sweep = |more: &[&str]| -> serde_json::Value {
        let mut command = program();
        command.args(["sweep", "--flights", "40", "--first", "300", "--json", "--out"]);
        let output = command.arg(folder.path()).args(more).output().unwrap();
        serde_json::from_slice(&output.stdout).unwrap()
    };
    for (kind, lookahead) in [("ardupilot", "1"), ("px4", "0")] {
        let setting = ["--autopilot-kind", kind, "--lookahead", lookahead];
        let report = sweep(&setting);
        let alone = [&setting[..], &["--jobs", "1"]].concat();
        assert_eq!(report, sweep(&alone), "on any number of threads");
        let flights: u64 =
            report["rows"].as_object().unwrap().values().map(|row| row["flights"].as_u64().unwrap()).sum();
        assert_eq!(flights, 40);
        let calm = sweep(&[&setting[..], &["--calm"]].concat());
        assert_eq!(calm["findings"], serde_json::json!([]));
    }
}

#[test]
fn help_is_no_error() {
    for words in [["--help"], ["--version"]] {
        let output = program().args(words).output().unwrap();
        assert!(output.status.success() && !output.stdout.is_empty());
    }
}

#[test]
fn serve_prints_its_ports_and_stops_when_interrupted() {
    let folder = tempfile::tempdir().unwrap();
    let mission = folder.path().join("mission.toml");
    let mut child = program()
        .args(["serve", "--scenario", "rb", "--companion", "tcpin:127.0.0.1:0", "--gcs", "udpin:127.0.0.1:0"])
        .args([Path::new("--mission-out"), &mission])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(|line| line.unwrap());
    let companion = lines.next().unwrap();
    let port = companion.strip_prefix("companion tcpin:127.0.0.1:").expect("the companion's port");
    assert_ne!(port, "0");
    // The autopilot sends to a peer that connects.
    let mut peer = std::net::TcpStream::connect(format!("127.0.0.1:{port}")).unwrap();
    let mut first = [0];
    std::io::Read::read_exact(&mut peer, &mut first).unwrap();
    assert_eq!(first, [0xFD]);
    assert_eq!(lines.next().as_deref(), Some("radio udpout:127.0.0.1:14600"));
    assert!(lines.next().unwrap().starts_with("gcs udpin:127.0.0.1:"));
    assert_eq!(lines.next(), Some(format!("mission {}", mission.display())));
    let text = std::fs::read_to_string(&mission).unwrap();
    let city = |name: &str| std::fs::read_to_string(folder.path().join(name)).map_err(|e| e.to_string());
    let read = mission_file::read(&text, city).unwrap();
    assert_eq!((read.devices.len(), read.terminal.x, read.terminal.y), (6, 20, 15));
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(interrupted.success());
    assert!(child.wait().unwrap().success());
}
