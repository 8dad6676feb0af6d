//! `gleaner-sitl fly --board`: a whole mission with a pilot in another process.
//!
//! The pilot is the Linux program `gleaner` on two sockets. `board.rs` does the same with the emulated board.

use gleaner_tests::programs::{self, Running, repository};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

/// An RB mission at w = 0 has two decisions; at ten times real time it takes 15 s.
const QUICK: [&str; 8] = ["--scenario", "rb", "--seed", "5", "--preference", "0", "--speedup", "8"];

struct FlownMission {
    report: Value,
    /// Decision records of the simulator and of the pilot.
    decisions: [Vec<Value>; 2],
}

/// Flies with `gleaner` on a line for the autopilot and, if it has one, on a line for the radio.
fn fly(arguments: &[&str], has_radio: bool) -> FlownMission {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (mission, out, log) = (at("mission.toml"), at("out"), at("log"));
    let any = "tcpin:127.0.0.1:0";
    let mut words = vec!["fly", "--json", "--board", any, "--mission-out", &mission, "--out", &out];
    words.extend(has_radio.then_some(["--radio", any]).into_iter().flatten());
    words.extend_from_slice(arguments);
    let mut city = Running::start("gleaner-sitl", &words);
    let connect = |endpoint: String| endpoint.replace("tcpin:", "tcpout:");
    let autopilot = connect(city.line("autopilot"));
    let radio = has_radio.then(|| connect(city.line("radio")));
    // The mission is announced last, after its file is written.
    city.line("mission");
    let model = repository().join("models/gleaner.onnx");
    let mut words = vec!["run", "--autopilot", &autopilot, "--mission", &mission, "--log", &log];
    words.extend_from_slice(&["--model", model.to_str().unwrap()]);
    words.extend(radio.iter().flat_map(|radio| ["--radio", radio]));
    let _pilot = Running::start("gleaner", &words);
    let report = city.line("{");
    assert_eq!(replayed(&log, "native"), "0.0e0", "the same engine, the same bits");
    let apart: f32 = replayed(&log, "tract").parse().unwrap();
    assert!(apart <= gleaner_policy::GOLDEN_TOLERANCE, "{apart}");
    let simulators: f32 = replayed(&out, "tract").parse().unwrap();
    assert!(simulators <= gleaner_policy::GOLDEN_TOLERANCE, "the simulator's log: {simulators}");
    let decisions = [&out, &log].map(|folder| lines(&Path::new(folder).join("decisions.jsonl")));
    FlownMission { report: serde_json::from_str(&format!("{{{report}")).unwrap(), decisions }
}

/// Replays a log, in which no decision may change; returns the largest difference of a logit.
fn replayed(log: &str, engine: &str) -> String {
    let model = repository().join("models/gleaner.onnx");
    let mut replay = Command::new(programs::path("gleaner"));
    replay.arg("replay").arg(Path::new(log).join("decisions.jsonl")).arg("--model").arg(model);
    let output = replay.args(["--engine", engine]).output().unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{stdout}");
    let furthest = stdout.lines().find_map(|line| line.strip_prefix("largest logit difference    "));
    furthest.unwrap().to_owned()
}

fn lines(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn check(flight: &FlownMission, decisions: usize, devices: usize) {
    let FlownMission { report, decisions: [harness, pilot] } = flight;
    let verdict = (&report["landed"], &report["violations"], &report["engine"]);
    assert_eq!(verdict, (&true.into(), &0.into(), &"board".into()), "{report}");
    assert_eq!((harness.len(), report["decisions"].as_u64().unwrap() as usize), (decisions, decisions));
    assert_eq!(pilot.len(), decisions);
    for (told, made) in harness.iter().zip(pilot) {
        for key in ["sequence", "cell", "action", "mask", "battery", "w_data", "logits", "attended"] {
            assert_eq!(told[key], made[key], "{key} of {told} and {made}");
        }
        let heard = made["tokens"]["devices"].as_array().unwrap();
        assert_eq!(heard.len(), devices);
        // Reports arrived: no SNR has the value of an absent one.
        assert!(heard.iter().all(|device| device[3].as_f64().unwrap() > -30.0), "{made}");
    }
}

#[test]
fn a_pilot_on_two_lines_reaches_the_terminal() {
    let flight = fly(&QUICK, true);
    check(&flight, 2, 6);
    assert_eq!(flight.report["energy"], 2.0);
}

#[test]
fn a_rotated_grid_flies_the_same_mission_over_the_wire() {
    let straight = fly(&QUICK, true);
    let rotated = fly(&[&QUICK[..], &["--grid-rotation", "-37.5"]].concat(), true);
    check(&rotated, 2, 6);
    let [(_, straight), (_, rotated)] =
        [straight, rotated].map(|FlownMission { decisions: [a, b], .. }| (a, b));
    for (straight, rotated) in straight.iter().zip(&rotated) {
        for key in ["cell", "action", "mask", "battery"] {
            assert_eq!(straight[key], rotated[key], "{key}");
        }
    }
}

#[test]
fn radio_reports_also_arrive_by_tunnel() {
    check(&fly(&QUICK, false), 2, 6);
}
