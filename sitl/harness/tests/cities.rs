//! City files from the field, and the import of building outlines.

use gleaner_pilot::mission_file;
use gleaner_units::Metres;
use gleaner_units::city_file::{CityFile, CityFileError, read_city};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn data(case: &str, file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/field").join(case).join(file)
}

fn city(case: &str) -> Result<CityFile, CityFileError> {
    read_city(&std::fs::read(data(case, "city.csv")).unwrap(), Metres(20.0))
}

/// The error of a whole mission with the city of this case.
fn mission_error(case: &str) -> String {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/companion/dist/mission.toml");
    let own = data(case, "mission.toml");
    let text = std::fs::read_to_string(if own.exists() { own } else { example }).unwrap();
    let read = |name: &str| std::fs::read_to_string(data(case, name)).map_err(|error| error.to_string());
    mission_file::read(&text, read).unwrap_err().to_string()
}

fn program(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gleaner-sitl")).args(arguments).output().unwrap()
}

#[test]
fn spreadsheets_with_marks_padding_and_semicolons_are_read() {
    let plain = city("06-bom-csv").unwrap();
    assert_eq!((plain.heights.grid().width(), plain.heights.grid().height()), (40, 30));
    for case in ["03-excel-semicolon", "07-trailing-commas"] {
        assert_eq!(city(case).unwrap(), plain, "{case}");
    }
}

#[test]
fn decimals_of_a_survey_are_rounded_up_and_counted() {
    let surveyed = city("05-lidar-decimals").unwrap();
    assert!(surveyed.rounded > 0);
    let exact = city("06-bom-csv").unwrap();
    let heights = surveyed.heights.as_slice().iter().zip(exact.heights.as_slice());
    assert!(heights.clone().all(|(rounded, exact)| rounded >= exact && rounded - exact <= 1));
    assert_eq!(heights.filter(|(rounded, exact)| rounded > exact).count(), surveyed.rounded);
}

#[test]
fn empty_cells_and_no_data_are_named_with_their_place() {
    let empty = mission_error("04-empty-cells");
    assert!(empty.contains("line 5, column 2: empty"), "{empty}");
    let no_data = mission_error("08-nodata");
    assert!(
        no_data.contains("line ") && no_data.contains("column ") && no_data.contains("no-data value"),
        "{no_data}"
    );
}

#[test]
fn geojson_as_heights_names_the_import_command() {
    let error = mission_error("01-geojson-osm");
    assert!(error.contains("gleaner-sitl city import"), "{error}");
}

#[test]
fn outlines_become_a_city_and_a_mission() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("devices.csv"), "lat,lon,id,data\n-35.36250,149.16600,7,5000\n").unwrap();
    let output = program(&[
        "city",
        "import",
        data("01-geojson-osm", "city.geojson").to_str().unwrap(),
        "--out",
        &path("city.csv"),
        "--bbox",
        "-35.3635,149.1650,-35.3610,149.1680",
        "--level-height",
        "3",
        "--devices",
        &path("devices.csv"),
        "--terminal",
        "-35.3612,149.1678",
        "--mission-out",
        &path("mission.toml"),
    ]);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(printed.contains("1 given, 1 from levels of 3 m, 0 by default"), "{printed}");
    let city = read_city(&std::fs::read(path("city.csv")).unwrap(), Metres(20.0)).unwrap();
    // 17.5 m rounded up, and six levels of 3 m.
    assert_eq!(city.heights.tallest(), Metres(18.0));
    assert!(city.heights.as_slice().iter().filter(|&&height_m| height_m == 18).count() >= 4);
    let text = std::fs::read_to_string(path("mission.toml")).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).map_err(|e| e.to_string());
    let mission = mission_file::read(&text, read).unwrap();
    assert_eq!((mission.devices[0].id, mission.devices.len()), (7, 1));
}

#[test]
fn a_plan_gives_fence_and_terminal_and_roofs_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    // Semicolons, a byte order mark and CRLF, as spreadsheets write. The device is inside the first building.
    std::fs::write(path("devices.csv"), "\u{feff}Lat;Lon;ID;Data\r\n-35.36285;149.16570;4000000000;5000\r\n")
        .unwrap();
    let plan = r#"{"fileType": "Plan", "geoFence": {"circles": [], "polygons": [{"inclusion": true, "polygon":
        [[-35.3634, 149.1651], [-35.3634, 149.1679], [-35.3615, 149.1679], [-35.3615, 149.1651]]}]},
        "rallyPoints": {"points": [[-35.3620, 149.1676, 50.0]]}}"#;
    std::fs::write(path("field.plan"), plan).unwrap();
    let footprints = data("01-geojson-osm", "city.geojson");
    let mut words =
        vec!["city", "import", footprints.to_str().unwrap(), "--bbox", "-35.3635,149.1650,-35.3610,149.1680"];
    let (out, devices, plan, mission) =
        (path("city.csv"), path("devices.csv"), path("field.plan"), path("mission.toml"));
    words.extend(["--out", &out, "--devices", &devices, "--plan", &plan, "--mission-out", &mission]);
    words.extend(["--rotation", "30", "--cell", "25"]);
    let output = program(&words);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(printed.contains("rotation 30.0 degrees") && printed.contains("cells of 25 m"), "{printed}");
    let text = std::fs::read_to_string(&mission).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).map_err(|e| e.to_string());
    let mission = mission_file::read(&text, read).unwrap();
    assert_eq!((mission.pose.rotation.0, mission.grid().cell()), (30.0, Metres(25.0)));
    assert_eq!(mission.devices[0].id, 4_000_000_000);
    assert!(mission.fence.len() > 20 && mission.fence.len() < mission.grid().len(), "the plan's fence");
    let roof = "warning      device 4000000000 at ";
    assert!(printed.contains(roof) && printed.contains("on a building of 18 m"), "{printed}");
    assert_eq!(printed.matches("warning").count(), 1, "{printed}");
}

#[test]
fn a_city_is_made_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("city.csv");
    let path = path.to_str().unwrap();
    assert!(program(&["city", "make", "--seed", "7", "--out", path]).status.success());
    let shown = program(&["city", "show", path]);
    let printed = String::from_utf8_lossy(&shown.stdout).into_owned();
    assert!(printed.starts_with("40 x 30 cells of 20 m, "), "{printed}");
    assert_eq!(printed.lines().count(), 32);
}
