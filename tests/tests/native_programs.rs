//! The native engine through the programs.

use gleaner_tests::programs::{path, repository};
use serde_json::Value;
use std::fs;
use std::process::{Command, Output};

fn gleaner(program: &str, arguments: &[&str]) -> Output {
    Command::new(path(program)).args(arguments).current_dir(repository()).output().unwrap()
}

fn stdout(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

#[test]
fn convert_writes_the_committed_file_or_half_its_size() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("model.gln");
    let convert = |weights| {
        let arguments =
            ["convert", "models/gleaner.onnx", "--out", out.to_str().unwrap(), "--weights", weights];
        let said = stdout(&gleaner("gleaner", &arguments));
        assert!(said.contains(&format!("weights {weights}, ")), "{said}");
        fs::read(&out).unwrap()
    };
    let whole = convert("f32");
    assert!(whole == fs::read(repository().join("models/gleaner.gln")).unwrap());
    let half = convert("i16");
    assert!(half.len() * 100 < whole.len() * 54, "{} of {} bytes", half.len(), whole.len());
}

#[test]
fn conversion_errors_are_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("model.gln");
    let out = out.to_str().unwrap();
    for (arguments, line) in [
        (
            vec!["convert", "README.md", "--out", out],
            "gleaner: model README.md: damaged, or not an ONNX model (",
        ),
        (
            vec!["convert", "models/gleaner.onnx", "--out", "/nowhere/x.gln"],
            "gleaner: /nowhere/x.gln: cannot be written: ",
        ),
        (
            vec!["convert", "models/gleaner.onnx", "--out", out, "--weights", "i8"],
            "gleaner: invalid value 'i8'",
        ),
        (
            vec!["bench", "--model", "models/gleaner.gln"],
            "gleaner: model models/gleaner.gln: a model file of the native engine",
        ),
    ] {
        let output = gleaner("gleaner", &arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), said.lines().count()), (Some(2), 1), "{said}");
        assert!(said.starts_with(line), "{said}");
    }
    assert!(!folder.path().join("model.gln").exists());
}

#[test]
fn bench_shows_both_engines_side_by_side() {
    let said =
        stdout(&gleaner("gleaner", &["bench", "--model", "models/gleaner.onnx", "--inferences", "20"]));
    let rows: Vec<Vec<f64>> = said
        .lines()
        .skip(3)
        .take_while(|line| !line.is_empty())
        .map(|line| line.split_whitespace().map(|number| number.parse().unwrap()).collect())
        .collect();
    assert!(!rows.is_empty(), "{said}");
    for row in rows {
        let [_, tract_least, tract_median, native_least, native_median, ratio] = row[..] else {
            panic!("{said}")
        };
        assert!(tract_least <= tract_median && native_least <= native_median && ratio > 0.0, "{said}");
    }
    let decisions: Vec<&str> = said.lines().skip_while(|line| !line.is_empty()).skip(1).collect();
    let [title, _, six, twelve, verdict] = decisions[..] else { panic!("{said}") };
    assert!(title.starts_with("one decision with look-ahead, 1000 tours"), "{said}");
    assert!(six.trim().starts_with("6 ") && twelve.trim().starts_with("12 "), "{said}");
    assert!(verdict.contains("a decision is due every 2000 ms"), "{said}");
}

#[test]
fn check_names_the_engine() {
    let folder = tempfile::tempdir().unwrap();
    for (model, engine, line) in [
        ("models/gleaner.gln", "native", "ok    engine     native, "),
        ("models/gleaner.onnx", "native", "ok    engine     native, "),
        ("models/gleaner.onnx", "tract", "ok    engine     tract"),
    ] {
        let dist = "firmware/companion/dist/gleaner.toml";
        let mut arguments =
            vec!["check", "--wait", "0", "--config", dist, "--model", model, "--engine", engine];
        arguments.extend(["--autopilot", "udpin:127.0.0.1:0", "--radio", "udp:127.0.0.1:0"]);
        arguments.extend(["--log", folder.path().to_str().unwrap()]);
        let said = stdout(&gleaner("gleaner", &arguments));
        assert!(said.lines().any(|said| said.starts_with(line)), "{said}");
    }
}

#[test]
fn a_mission_is_the_same_in_both_engines() {
    let fly = |model, engine| -> Value {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().to_str().unwrap();
        let mission =
            ["fly", "--json", "--out", out, "--preference", "0.7", "--seed", "5", "--switch", "60:0.2"];
        let arguments = [&mission[..], &["--model", model, "--engine", engine]].concat();
        let mut report: Value = serde_json::from_str(&stdout(&gleaner("gleaner-sitl", &arguments))).unwrap();
        assert_eq!(report["engine"], engine);
        for own in ["engine", "wall_s"] {
            report.as_object_mut().unwrap().remove(own);
        }
        report
    };
    let tract = fly("models/gleaner.onnx", "tract");
    assert_eq!(tract, fly("models/gleaner.onnx", "native"));
    assert_eq!(tract, fly("models/gleaner.gln", "native"));
}
