//! Two processes, real sockets, and ground stations by other authors.
//!
//! `gleaner-sitl serve` is the autopilot, the radio and the city; `gleaner run` is the pilot. pymavlink, MAVSDK and
//! MAVProxy each read and set parameters, engage, change the preference in flight, and take over. Run them alone, after
//! the programs are built, with
//! `cargo test --release --workspace --test ground_station -- --nocapture`.

use gleaner_tests::programs::repository;
use gleaner_tests::python;
use gleaner_tests::serving::{Link, Serving};
use serde_json::Value;
use std::fs;

/// The terminal of RD.
const TERMINAL: [i64; 2] = [30, 18];

/// What a ground station's script has seen.
fn judged_by(script: &str, scheme: &str, serving: &Serving) -> Value {
    judged_with(script, &[&format!("{scheme}{}", serving.station)])
}

/// As [`judged_by`], with these arguments.
fn judged_with(script: &str, arguments: &[&str]) -> Value {
    let seen = python::run(script, arguments).unwrap_or_else(|cause| panic!("{cause:#}"));
    println!("{script}: {seen}");
    serde_json::from_str(seen.lines().last().expect("a line")).expect("JSON")
}

fn texts(seen: &Value) -> Vec<&str> {
    seen["texts"].as_array().unwrap().iter().map(|text| text.as_str().unwrap()).collect()
}

#[test]
fn pymavlink_engages_switches_and_takes_over() {
    let serving = Serving::start(Link::Tcp, &[]);
    let seen = judged_by("ground_station.py", "udpout:", &serving);
    for word in ["engaged", "preference", "passive"] {
        assert!(texts(&seen).iter().any(|text| text.contains(word)), "no text about {word:?}: {seen}");
    }

    let decisions = fs::read_to_string(serving.decisions()).unwrap();
    let decisions: Vec<Value> = decisions.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let under = |w_data: f64| decisions.iter().filter(move |decision| decision["w_data"] == w_data);
    let (for_data, for_energy) = (under(1.0).count(), under(0.0).count());
    assert!(for_data >= 10, "{for_data} decisions at w = 1");
    assert!(for_energy >= 5, "{for_energy} decisions at w = 0");
    for decision in &decisions {
        let allowed = decision["mask"].as_array().unwrap();
        assert!(allowed.contains(&decision["action"]), "outside the guard's mask: {decision}");
    }
    // For energy alone, every decision is a move towards the terminal.
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

#[test]
fn mavsdk_engages_switches_and_takes_over() {
    let seen = judged_by("mavsdk_station.py", "udpout://", &Serving::start(Link::Tcp, &[]));
    assert!(seen["decisions"].as_u64().unwrap() >= 2, "{seen}");
}

#[test]
fn mavproxy_engages_switches_and_takes_over() {
    let seen = judged_by("mavproxy_station.py", "udpout:", &Serving::start(Link::Tcp, &[]));
    assert!(seen["decisions"].as_u64().unwrap() >= 3, "{seen}");
}

#[test]
fn pymavlink_and_mavsdk_read_the_parameter_metadata() {
    let seen = judged_by("metadata_station.py", "", &Serving::start(Link::Tcp, &[]));
    let parameters = seen["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), gleaner_link::PARAMETERS.len());
    for (read, spec) in parameters.iter().zip(gleaner_link::PARAMETERS) {
        assert_eq!(read["name"], spec.name);
        let bound = |key: &str| read[key].as_f64().unwrap() as f32;
        assert_eq!((bound("min"), bound("max")), (spec.min, spec.max), "{read}");
        assert_eq!(read["units"].as_str().unwrap_or(""), spec.unit, "{read}");
    }
}

#[test]
fn every_button_and_command_of_the_kit_works() {
    let serving = Serving::start(Link::Tcp, &[]);
    let kit = repository().join("firmware/companion/dist/ground-station");
    let connection = format!("udpout:{}", serving.station);
    let seen = judged_with("kit_station.py", &[&connection, kit.to_str().unwrap()]);
    assert!(seen["results"].as_object().unwrap().len() >= 8, "{seen}");
}
