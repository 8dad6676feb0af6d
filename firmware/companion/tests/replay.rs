//! `gleaner replay`: decisions are made again, and those that change are listed.

mod fixture;

use fixture::{Fixture, LOGITS, outcome};
use gleaner_policy::LOCAL_MAP_CELLS;
use serde_json::{Value, json};

/// A line of the log as `gleaner run` writes it: the model answers [`LOGITS`] to everything.
fn line(sequence: u32) -> Value {
    json!({
        "run_s": 7, "sequence": sequence, "time_us": 1, "state": "engaged", "cell": [1, 0], "action": "hover",
        "mask": ["hover", "east"], "battery": 20.0, "spare": 16.0, "w_data": 0.25, "collected": 0.0,
        "logits": LOGITS, "attended": 0, "infer_us": 50, "slots": [0],
        "tokens": {
            "uav": [16.0, 20.0, 40.0, 40.0], "preference": [0.25, 0.75], "local_map": vec![0.0; LOCAL_MAP_CELLS],
            "devices": [[20.0, 20.0, 6000.0, -34.0, 0.0, 20.0, 0.0]],
        },
    })
}

fn replay(text: &str) -> (Option<i32>, String, String) {
    let fixture = Fixture::new();
    fixture.write("decisions.jsonl", text);
    let mut replay = std::process::Command::new(env!("CARGO_BIN_EXE_gleaner"));
    replay.arg("replay").arg(fixture.path("decisions.jsonl")).arg("--model").arg(fixture.path("policy.onnx"));
    outcome(&replay.env_remove("RUST_BACKTRACE").output().unwrap())
}

/// Equal, different, by the guard, skipped; and the largest difference of a logit.
fn counts(stdout: &str) -> Vec<&str> {
    let lines: Vec<&str> = stdout.lines().collect();
    lines[lines.len() - 5..].iter().filter_map(|line| line.split_whitespace().last()).collect()
}

#[test]
fn decisions_as_logged_are_counted() {
    let mut guards = line(2);
    guards["logits"] = Value::Null;
    guards["action"] = json!("east");
    let (code, stdout, stderr) = replay(&format!("{}\n{}\n{guards}\n", line(0), line(1)));
    assert_eq!((code, stderr.as_str()), (Some(0), ""), "{stdout}");
    assert_eq!(counts(&stdout), ["2", "0", "1", "0", "0.0e0"]);
}

#[test]
fn a_decision_that_changes_is_listed_and_makes_the_verdict() {
    let mut other = line(1);
    other["action"] = json!("east");
    other["logits"] = json!([4.5, 4.0, 3.0, 2.0, 5.0]);
    let (code, stdout, stderr) = replay(&format!("{}\n{other}\n", line(0)));
    assert_eq!((code, stderr.as_str()), (Some(1), ""), "{stdout}");
    let expected = "run 7, decision 1: logged east, now hover; logits differ by up to 4.0e0";
    assert!(stdout.lines().any(|line| line == expected), "{stdout}");
    assert_eq!(counts(&stdout), ["1", "1", "0", "0", "4.0e0"]);
}

#[test]
fn the_logged_mask_applies_to_the_replay() {
    // The model prefers to hover, which was not allowed.
    let mut masked = line(0);
    masked["mask"] = json!(["east", "north"]);
    masked["action"] = json!("north");
    let (code, stdout, _) = replay(&masked.to_string());
    assert_eq!(code, Some(0), "{stdout}");
}

#[test]
fn a_log_without_decisions_of_the_model_fails() {
    let mut guards = line(0);
    guards["logits"] = Value::Null;
    let (code, stdout, _) = replay(&guards.to_string());
    assert_eq!((code, counts(&stdout)), (Some(1), vec!["0", "0", "1", "0", "0.0e0"]), "{stdout}");
}

#[test]
fn half_a_line_is_skipped_and_reported() {
    let whole = line(0).to_string();
    let (code, stdout, _) = replay(&format!("{}\n{whole}\n", &whole[..100]));
    assert_eq!(code, Some(0), "{stdout}");
    assert!(stdout.contains("line 1 is not a decision: "), "{stdout}");
    assert_eq!(counts(&stdout), ["1", "0", "0", "1", "0.0e0"]);
}

#[test]
fn other_files_are_refused_in_one_line() {
    for text in ["", "\n\n", "not a log\n", "{}\n"] {
        let (code, _, stderr) = replay(text);
        assert_eq!((code, stderr.lines().count()), (Some(2), 1), "{text:?}: {stderr}");
        assert!(stderr.contains("decisions.jsonl") && stderr.contains("holds no decision"), "{stderr}");
    }
    let mut unknown = line(0);
    unknown["mask"] = json!(["hover", "up"]);
    let (code, stdout, _) = replay(&unknown.to_string());
    assert_eq!(code, Some(2));
    assert!(stdout.contains("there is no action \"up\""), "{stdout}");
}
