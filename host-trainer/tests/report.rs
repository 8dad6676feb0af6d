//! The report command: one self-contained page, CSV files, parts that are kept, and bad input refused.

use clap::Parser;
use gleaner_host_trainer::keep::curves::CURVE;
use gleaner_host_trainer::keep::snapshot::Snapshot;
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::settings::Settings;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

#[derive(Parser)]
struct Defaults {
    #[command(flatten)]
    settings: Settings,
}

/// An untrained run with one point in its curve.
fn run_folder(folder: &Path) {
    let learned = Snapshot {
        system: "gleaner".into(),
        method: "train".into(),
        settings: Defaults::parse_from(["train"]).settings,
        actor: Shape::actor().initialise(&mut ChaCha8Rng::seed_from_u64(1)),
        update: 10,
        steps: 40,
        score: 1.0,
    };
    learned.save(folder).unwrap();
    curve(folder, 60.0);
}

/// A folder with a learning curve of one point.
fn curve(folder: &Path, coverage_percent: f64) {
    let point = serde_json::json!({
        "update": 10, "unix_s": 1.5, "steps": 40, "rd/hypervolume": 5000.5, "rd/coverage_percent": coverage_percent,
    });
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join(CURVE), format!("{point}\n")).unwrap();
}

fn report(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gleaner-train")).arg("report").args(arguments).output().unwrap()
}

fn refused(arguments: &[&str]) -> String {
    let output = report(arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    message
}

#[test]
fn report_makes_page_and_csv_and_reuses_its_parts() {
    let folder = tempfile::tempdir().unwrap();
    let (run, out) = (folder.path().join("run"), folder.path().join("out"));
    fs::create_dir(&run).unwrap();
    run_folder(&run);
    // An oracle of one setting: eleven preferences, one realization, and its bound.
    let missions: Vec<_> =
        (0..11).map(|i| [[30.0 + 6.0 * f64::from(i), -32.0 - 4.0 * f64::from(i)]]).collect();
    let oracle = folder.path().join("oracle.jsonl");
    let line = serde_json::json!({
        "scenario": "rd", "devices": 6, "battery": 80, "realizations": 1, "missions": missions,
        "upper_bound_percent": [97.25],
    });
    fs::write(&oracle, format!("{line}\n")).unwrap();
    // Two seeds of one training.
    let seeds = [61.25, 63.25].map(|coverage| {
        let seed = folder.path().join(coverage.to_string());
        curve(&seed, coverage);
        format!("two seeds={}", seed.display())
    });
    let arguments = [
        "--run",
        &format!("untrained={}", run.display()),
        "--curve",
        &seeds[0],
        "--curve",
        &seeds[1],
        "--oracle",
        oracle.to_str().unwrap(),
        "--realizations",
        "1",
        "--fading-repeats",
        "2",
        "--out",
        out.to_str().unwrap(),
    ];
    let output = report(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let page = fs::read_to_string(out.join("report.html")).unwrap();
    for outside in ["http://", "https://", "<script", "<link", "src=", "url("] {
        assert!(!page.contains(outside), "the page asks for {outside}");
    }
    for shown in [
        "untrained",
        "GREEDY",
        "ORACLE",
        "97.2",
        "about 87",
        "not computed",
        "87.49 ± 0.16",
        "5000",
        "two seeds",
        "62.2 ± 1.4",
    ] {
        assert!(page.contains(shown), "{shown} is not on the page");
    }
    let lines = |name: &str| fs::read_to_string(out.join(name)).unwrap().lines().count() - 1;
    // Two systems in ten settings and the oracle in one; eleven preferences each.
    assert_eq!((lines("metrics.csv"), lines("fronts.csv"), lines("missions.csv")), (21, 231, 231));
    // Two scenarios, two channels, two repeats; two preferences, four kinds or 15 x 15 tokens.
    assert_eq!((lines("fading.csv"), lines("attention.csv"), lines("attention_initial.csv")), (8, 8, 450));
    assert_eq!((lines("engines.csv"), lines("curves.csv"), lines("trainings.csv")), (2, 9, 1));
    assert!(lines("trajectories.csv") > 6 && lines("published.csv") > 20);

    // Only a damaged part is measured again, with a message and the same numbers.
    let metrics = fs::read(out.join("metrics.csv")).unwrap();
    let part = fs::read_dir(out.join("parts")).unwrap().next().unwrap().unwrap().path();
    fs::write(&part, "no part").unwrap();
    let output = report(&arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && message.contains("damaged part, measured again"), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(metrics == fs::read(out.join("metrics.csv")).unwrap());
}

#[test]
fn bad_input_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "{\"scenario\":\"rd\"}\n").unwrap();
    let (file, nowhere) = (file.to_str().unwrap(), folder.path().join("nowhere"));
    let (empty, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let out = ["--out", out.to_str().unwrap()];
    let message_of = |arguments: &[&str]| refused(&[arguments, &out[..]].concat());
    assert!(message_of(&["--run", nowhere.to_str().unwrap()]).contains("no such folder"));
    assert!(message_of(&["--run", empty]).contains("no parameters yet"));
    assert!(message_of(&["--model", file]).contains("not an ONNX model"));
    assert!(message_of(&["--oracle", file, "--run", empty]).contains("no parameters yet"));
    assert!(message_of(&["--realizations", "0"]).contains("no mission to fly"));
    run_folder(folder.path());
    assert!(message_of(&["--oracle", file, "--run", empty]).contains("line 1 is not a line"));
    assert!(message_of(&["--run", empty, "--run", empty]).contains("two systems have the name"));
}
