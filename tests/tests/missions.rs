//! Requirements on the shipped policy in the simulated city, through the program.

use gleaner_tests::programs;
use serde_json::Value;
use std::process::Command;

/// Seeds of the comparison with GREEDY.
const SEEDS: u64 = 20;
/// What look-ahead collects beyond GREEDY at least, percentage points.
const LEAD: f64 = 20.0;

fn fly(arguments: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(programs::path("gleaner-sitl"))
        .current_dir(programs::repository())
        .args(["fly", "--json", "--out"])
        .arg(folder.path())
        .args(arguments)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "gleaner-sitl fly {arguments:?}: {said}");
    for file in ["trajectory.svg", "flight.tlog", "decisions.jsonl"] {
        assert!(folder.path().join(file).metadata().unwrap().len() > 300, "{file} of {arguments:?}");
    }
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_json_report_has_the_documented_keys() {
    let report = fly(&["--scenario", "rd", "--preference", "0.5", "--seed", "4", "--switch", "60:0"]);
    let mut keys: Vec<&str> = report.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    let contract = [
        "collected",
        "decisions",
        "devices",
        "energy",
        "engine",
        "landed",
        "model",
        "preference",
        "scenario",
        "seed",
        "switches",
        "violations",
        "wall_s",
    ];
    assert_eq!(keys, contract);
    assert_eq!(report["switches"], 1);
    assert_eq!(report["engine"], "native");
}

/// At nominal consumption the learned battery prices stay nominal, so that no flight goes home early.
#[test]
fn nominal_flights_spend_their_budget_on_data() {
    for autopilot in ["ardupilot", "px4"] {
        for seed in ["3", "5"] {
            let report = fly(&["--preference", "0.9", "--seed", seed, "--autopilot-kind", autopilot]);
            assert!(report["collected"].as_f64().unwrap() > 0.95, "{autopilot}: {report}");
        }
    }
}

#[test]
fn at_w_0_the_shortest_way_is_flown() {
    for seed in ["1", "2", "3"] {
        let direct = fly(&["--scenario", "rd", "--preference", "0", "--seed", seed]);
        assert_eq!((&direct["energy"], &direct["decisions"]), (&32.0.into(), &32.into()), "{direct}");
        let around = fly(&["--scenario", "rb", "--preference", "0", "--seed", seed]);
        assert_eq!((&around["energy"], &around["decisions"]), (&2.0.into(), &2.into()), "{around}");
    }
}

/// The mean of 20 seeds, flown through MAVLink with each autopilot, against GREEDY on the same realizations on the grid. The
/// lead is that of flights on the grid, so a flight that goes home early at nominal consumption fails this.
#[test]
fn at_w_1_the_policy_collects_much_more_than_greedy() {
    for scenario in ["rd", "rb"] {
        let greedy = greedy_percent(scenario);
        for autopilot in ["ardupilot", "px4"] {
            let mut sum = 0.0;
            for seed in 0..SEEDS {
                let seed = seed.to_string();
                let kind = ["--scenario", scenario, "--autopilot-kind", autopilot];
                let report = fly(&[&kind[..], &["--preference", "1", "--seed", &seed]].concat());
                assert_eq!((&report["landed"], &report["violations"]), (&true.into(), &0.into()), "{report}");
                assert!(report["energy"].as_f64().unwrap() <= 80.0, "{report}");
                sum += report["collected"].as_f64().unwrap();
            }
            let policy = 100.0 * sum / SEEDS as f64;
            let line = format!("{scenario}, {autopilot}: policy {policy:.1} %, GREEDY {greedy:.1} %");
            println!("{line}, mean of {SEEDS} seeds");
            assert!(policy > greedy + LEAD, "{line}");
        }
    }
}

fn greedy_percent(scenario: &str) -> f64 {
    let output = Command::new(programs::path("gleaner-train"))
        .args(["evaluate", "--json", "--scenario", scenario, "--realizations", &SEEDS.to_string()])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let tables: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = tables["GREEDY"]["rows"].as_array().unwrap();
    rows.last().unwrap()["data_percent"].as_f64().unwrap()
}
