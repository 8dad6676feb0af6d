//! The commands as a user runs them: interruption, bad arguments, export, one's own city and mission.

use gleaner_host_trainer::keep::snapshot::Snapshot;
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::settings::Settings;
use gleaner_world::City;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_gleaner-train"))
}

fn run(arguments: &[&str]) -> Output {
    program().args(arguments).output().unwrap()
}

/// Standard output of a command that succeeds.
fn succeeds(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Standard error of a command that is refused.
fn refused(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    String::from_utf8(output.stderr).unwrap()
}

const SMALL: [&str; 10] =
    ["train", "--system", "mosac-ftv", "--warm-up", "20", "--batch", "2", "--replay", "50", "--out"];

#[test]
#[cfg(unix)]
fn ctrl_c_saves_and_the_next_run_continues() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let mut child = program()
        .args(SMALL)
        .args([out, "--updates", "100000000"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.any(|line| line.unwrap().starts_with("training")), "it announces the training");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{message}");
    let message = message.lines().last().unwrap();
    assert!(message.contains("run the same command again to continue"), "{message}");
    let update = message.split("at update ").nth(1).unwrap().split(';').next().unwrap();
    // A run with as many updates as it has is done at once.
    let text = succeeds(&[&SMALL[..], &[out, "--updates", update]].concat());
    assert!(text.contains(&format!("continuing from update {update} of {update}")), "{text}");
}

#[test]
fn shares_and_counts_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let train = |more: &[&str]| refused(&[&SMALL[..], &[out], more].concat());
    assert!(train(&["--share-rd", "0.8", "--share-rb", "0.5"]).contains("add up to more than 1"));
    assert!(train(&["--share-rd", "1.5"]).contains("between 0 and 1"));
    assert!(train(&["--n-step", "0"]).contains("--n-step 0"));
    assert!(train(&["--preset", "papers"]).contains("use paper"));
    assert!(train(&["--local-map", "four-layers"]).contains("only mosac-att"));
    assert!(refused(&["evaluate", "--devices", "0"]).contains("--devices 0"));
    assert!(refused(&["evaluate", "--map-error", "missing=2"]).contains("between 0 and 1"));
    assert!(refused(&["evalute"]).contains("'evaluate'"));
}

#[test]
fn export_works_without_git_and_makes_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("my-run");
    Snapshot {
        system: "gleaner".into(),
        method: "train".into(),
        settings: Settings::default(),
        actor: Shape::actor().initialise(&mut ChaCha8Rng::seed_from_u64(1)),
        update: 1,
        steps: 4,
        score: 0.0,
    }
    .save(&run)
    .unwrap();
    let output = program()
        .current_dir(folder.path())
        .env("GIT_CEILING_DIRECTORIES", folder.path().parent().unwrap())
        .args(["export", "--run", "my-run", "--model", "new/folder/my.onnx", "--realizations", "1"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let card = fs::read_to_string(folder.path().join("new/folder/my.md")).unwrap();
    assert!(card.starts_with("# Model card: my-run\n"), "{card}");
    assert!(card.contains("| commit | `unknown` |"), "{card}");
}

/// Data of GREEDY at w = (1, 0), percent.
fn greedy_percent(arguments: &[&str]) -> f64 {
    let json = succeeds(&[&["evaluate", "--json", "--realizations", "4"], arguments].concat());
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    value["GREEDY"]["rows"][10]["data_percent"].as_f64().unwrap()
}

#[test]
fn mismatch_changes_what_a_policy_collects() {
    let nominal = greedy_percent(&["--scenario", "RD"]);
    assert!(greedy_percent(&["--scenario", "rd", "--noise", "6"]) < nominal - 2.0);
    assert!(greedy_percent(&["--noise", "-6"]) > nominal);
    assert!(greedy_percent(&["--exponent", "0.3"]) < nominal - 2.0);
    assert_eq!(greedy_percent(&["--no-map"]), nominal, "GREEDY has no map to lose");
    let heading = succeeds(&["evaluate", "--realizations", "1", "--noise", "3", "--no-map"]);
    assert!(heading.starts_with("rd, K = 6, B = 80, 1 realizations, noise +3 dB, no map\n"), "{heading}");
}

/// A city of 12 x 10 cells with one block, and a mission file for it.
fn write_mission(folder: &Path) {
    let row =
        |y: usize| (0..12).map(move |x| if (4..6).contains(&x) && (3..6).contains(&y) { "20" } else { "0" });
    let rows: Vec<String> = (0..10).map(|y| row(y).collect::<Vec<_>>().join(",")).collect();
    fs::write(folder.join("city.csv"), rows.join("\n") + "\n").unwrap();
    let mission = "terminal = [10, 8]\nbattery_units = 60.0\n\n[grid]\ncorner_lat_deg = -35.3\n\
                   corner_lon_deg = 149.1\ncell_m = 20.0\nheights = \"city.csv\"\n\n[[device]]\nid = 1\n\
                   cell = [2, 2]\ndata = 6000.0\n\n[[device]]\nid = 2\ncell = [7, 1]\ndata = 5000.0\n";
    fs::write(folder.join("mission.toml"), mission).unwrap();
}

#[test]
fn own_city_and_mission_are_trained_and_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    write_mission(folder.path());
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (city, mission, out) = (path("city.csv"), path("mission.toml"), path("run"));
    let (city, mission, out) = (&city[..], &mission[..], &out[..]);
    assert!(City::from_csv(&fs::read_to_string(city).unwrap()).is_ok());

    let text = succeeds(&["evaluate", "--mission", mission, "--realizations", "2"]);
    assert!(text.starts_with("rd, K = 2, B = 60, 2 realizations"), "{text}");
    let text = succeeds(&["evaluate", "--city", city, "--devices", "3", "--realizations", "2"]);
    assert!(text.starts_with("rd, K = 3, B = 80, 2 realizations"), "{text}");

    let train = [&SMALL[..], &[out, "--updates", "2", "--validate-every", "2"]].concat();
    succeeds(&[&train[..], &["--mission", mission, "--share-rd", "0.5", "--share-rb", "0.5"]].concat());
    succeeds(&["evaluate", "--mission", mission, "--run", out, "--realizations", "1"]);
    let error = refused(&[&train[..], &["--share-rd", "0.5", "--share-rb", "0.5"]].concat());
    assert!(error.contains("other settings (site"), "a run belongs to its city: {error}");
    assert!(refused(&["evaluate", "--mission", &path("none.toml")]).contains("none.toml"));
}
