//! Two processes of ours, real sockets, and a ground station that none of us wrote.
//!
//! `gleaner-sitl serve` is the autopilot, the radio and the city; `gleaner run` is the pilot; pymavlink engages it,
//! turns its preference by parameter and by command, refuses to be obeyed with impossible values, and takes over.
//! Run it alone, after the programs are built, with
//! `cargo test --release --workspace --test ground_station -- --nocapture`.

use gleaner_tests::programs::{Running, repository};
use gleaner_tests::python;
use serde_json::Value;
use std::fs;

/// The vehicle lives five times as fast as the wall, so that a take-off takes six seconds. The pilot keeps the
/// wall's time, as it always does.
const SPEED: &str = "5";
/// The terminal of RD.
const TERMINAL: [i64; 2] = [30, 18];

#[test]
fn an_operator_engages_switches_and_takes_over() {
    let folder = tempfile::tempdir().unwrap();
    let mission = folder.path().join("mission.toml");
    let mission = mission.to_str().unwrap();
    let out = folder.path().join("flight");
    let any = "tcpin:127.0.0.1:0";
    let mut city = Running::start(
        "gleaner-sitl",
        &[
            "serve",
            "--scenario",
            "rd",
            "--seed",
            "3",
            "--speed",
            SPEED,
            "--companion",
            any,
            "--radio",
            any,
            "--gcs",
            "udpin:127.0.0.1:0",
            "--mission-out",
            mission,
            "--out",
            out.to_str().unwrap(),
        ],
    );
    let address = |endpoint: String| endpoint.split_once(':').unwrap().1.to_owned();
    let companion = address(city.line("companion"));
    let radio = address(city.line("radio"));
    let station = address(city.line("gcs"));
    let model = repository().join("models/gleaner.onnx");
    let log = folder.path().join("log");
    let _pilot = Running::start(
        "gleaner",
        &[
            "run",
            "--autopilot",
            &format!("tcpout:{companion}"),
            "--radio",
            &format!("tcpout:{radio}"),
            "--model",
            model.to_str().unwrap(),
            "--mission",
            mission,
            "--log",
            log.to_str().unwrap(),
        ],
    );

    let seen = python::run("ground_station.py", [format!("udpout:{station}")])
        .unwrap_or_else(|cause| panic!("{cause:#}"));
    println!("the ground station saw {seen}");
    let seen: Value = serde_json::from_str(seen.lines().last().unwrap()).unwrap();
    let texts: Vec<&str> =
        seen["texts"].as_array().unwrap().iter().map(|text| text.as_str().unwrap()).collect();
    for word in ["engaged", "preference", "passive"] {
        assert!(texts.iter().any(|text| text.contains(word)), "nothing was said of {word:?}: {texts:?}");
    }

    let decisions = fs::read_to_string(log.join("decisions.jsonl")).unwrap();
    let decisions: Vec<Value> = decisions.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let under = |w_data: f64| decisions.iter().filter(move |decision| decision["w_data"] == w_data);
    let (for_data, for_energy) = (under(1.0).count(), under(0.0).count());
    assert!(for_data >= 10, "{for_data} decisions at w = 1");
    assert!(for_energy >= 5, "{for_energy} decisions at w = 0");
    for decision in &decisions {
        let allowed = decision["mask"].as_array().unwrap();
        assert!(allowed.contains(&decision["action"]), "outside the guard's mask: {decision}");
    }
    // The behaviour changes: for energy alone, every decision is a move that brings the terminal nearer.
    assert!(under(0.0).all(approaches), "w = 0 does not head for the terminal");
    assert!(!under(1.0).all(approaches), "w = 1 heads for the terminal like w = 0");
}

fn approaches(decision: &Value) -> bool {
    let cell = |axis: usize| decision["cell"][axis].as_i64().unwrap();
    let (east, north) = (TERMINAL[0] - cell(0), TERMINAL[1] - cell(1));
    match decision["action"].as_str().unwrap() {
        "east" => east > 0,
        "west" => east < 0,
        "north" => north > 0,
        "south" => north < 0,
        _ => false,
    }
}
