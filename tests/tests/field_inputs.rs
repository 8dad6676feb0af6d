//! `gleaner check` over files as people have them (`tests/field`): read, warned about, or refused with the cause.

use gleaner_tests::programs::{path, repository};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// One input: folder, mission file in it, exit code, and parts of what is printed, in order.
type Row = (&'static str, &'static str, i32, &'static [&'static str]);

const ROWS: [Row; 28] = [
    (
        "01-geojson-osm",
        "mission.toml",
        1,
        &["FAIL  mission", "city.geojson", "convert it with `gleaner-sitl city import`"],
    ),
    ("03-excel-semicolon", "mission.toml", 0, &["ok    mission", "40 x 30 cells", "ready"]),
    ("04-empty-cells", "mission.toml", 1, &["FAIL  mission", "city.csv", "line 5, column 2: empty cell"]),
    (
        "05-lidar-decimals",
        "mission.toml",
        0,
        &["ok    mission", "ok    heights    ", " of 1200 had decimals and were rounded up", "ready"],
    ),
    ("06-bom-csv", "mission.toml", 0, &["ok    mission", "40 x 30 cells", "ready"]),
    ("07-trailing-commas", "mission.toml", 0, &["ok    mission", "40 x 30 cells", "ready"]),
    ("08-nodata", "mission.toml", 1, &["FAIL  mission", "line ", "column ", "no-data value"]),
    ("09-toml-bom", "mission.toml", 0, &["ok    config", "ok    mission", "ready"]),
    ("10-toml-crlf", "mission.toml", 0, &["ok    config", "ok    mission", "ready"]),
    ("11-toml-utf16", "mission.toml", 2, &["gleaner.toml: the file is UTF-16: save as UTF-8"]),
    ("13-many-devices", "mission13.toml", 0, &["warn  devices    13: the policy sees 12 at a time"]),
    ("13-many-devices", "mission30.toml", 0, &["warn  devices    30: the policy sees 12 at a time"]),
    ("13-many-devices", "mission64.toml", 0, &["warn  devices    64: the policy sees 12 at a time"]),
    ("13-many-devices", "mission65.toml", 1, &["FAIL  mission", "more than 64 devices: take some out"]),
    (
        "14-roofs",
        "mission.toml",
        1,
        &["FAIL  mission", "line 4: the terminal (8, 29) is on a building of 50 m"],
    ),
    (
        "14-roofs",
        "stated.toml",
        0,
        &[
            "warn  terminal   (8, 29) is on a building of 50 m",
            "warn  device     device 1 at (14, 25) is on a building of 26 m",
        ],
    ),
    ("15-ids", "big.toml", 0, &["ok    mission", "6 devices", "ready"]),
    ("15-ids", "hex.toml", 0, &["ok    mission", "6 devices", "ready"]),
    ("15-ids", "devaddr.toml", 0, &["ok    mission", "6 devices", "ready"]),
    ("15-ids", "dup.toml", 1, &["FAIL  mission", "line 22: device 1 is already in line 17"]),
    ("16-latlon", "ok.toml", 0, &["ok    mission", "6 devices", "ready"]),
    (
        "16-latlon",
        "swapped.toml",
        1,
        &["FAIL  mission", "line 17: device 1: ", "are no place: they are swapped"],
    ),
    (
        "16-latlon",
        "wrong-hemisphere.toml",
        1,
        &["FAIL  mission", "line 17: device 1: ", " km from its corner: lat_deg has the wrong sign"],
    ),
    ("16-latlon", "decimal-comma.toml", 1, &["FAIL  mission", "line 19: a decimal comma: write a point"]),
    ("17-cell-size", "cell1.toml", 0, &["warn  cell size  1 m: the policy was trained at 20 m"]),
    ("17-cell-size", "cell5.toml", 0, &["warn  cell size  5 m: the policy was trained at 20 m"]),
    ("17-cell-size", "cell50.toml", 0, &["warn  cell size  50 m: the policy was trained at 20 m"]),
    ("17-cell-size", "cell100.toml", 0, &["warn  cell size  100 m: the policy was trained at 20 m"]),
];

/// Copies the example mission and city into `folder`, and the input over them.
fn lay_out(folder: &Path, case: &str) {
    let sources = [repository().join("firmware/companion/dist"), repository().join("tests/field").join(case)];
    for source in sources {
        for entry in fs::read_dir(source).unwrap().flatten().filter(|entry| entry.path().is_file()) {
            fs::copy(entry.path(), folder.join(entry.file_name())).unwrap();
        }
    }
    if case == "14-roofs" {
        let text = fs::read_to_string(folder.join("mission.toml")).unwrap().replace("[14, 4]", "[14, 25]");
        fs::write(folder.join("stated.toml"), format!("terminal_height_m = 50\n{text}")).unwrap();
    }
}

/// `gleaner check` with this mission. The ports are free ones: other tests run at the same time.
fn check(folder: &Path, mission: &str) -> Output {
    let mut gleaner = Command::new(path("gleaner"));
    gleaner.args([
        "check",
        "--wait",
        "0",
        "--autopilot",
        "udpin:127.0.0.1:0",
        "--radio",
        "udpin:127.0.0.1:0",
    ]);
    gleaner.arg("--config").arg(folder.join("gleaner.toml")).arg("--mission").arg(folder.join(mission));
    gleaner.arg("--model").arg(repository().join("models/gleaner.onnx"));
    gleaner.output().unwrap()
}

#[test]
fn each_field_input_is_read_or_refused_as_documented() {
    let mut faults = Vec::new();
    for (case, mission, code, parts) in ROWS {
        let folder = tempfile::tempdir().unwrap();
        lay_out(folder.path(), case);
        let output = check(folder.path(), mission);
        let printed = [&output.stdout[..], &output.stderr].concat();
        let printed = String::from_utf8(printed).unwrap();
        let mut rest = printed.as_str();
        let found = parts.iter().all(|part| {
            let Some(at) = rest.find(part) else { return false };
            rest = &rest[at + part.len()..];
            true
        });
        if output.status.code() != Some(code) || !found {
            faults.push(format!(
                "{case}/{mission}: {:?}, not {code} with {parts:?}:\n{printed}",
                output.status
            ));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
