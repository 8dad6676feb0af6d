//! Mission files, read and written.

use gleaner_pilot::DeviceSite;
use gleaner_pilot::mission_file::{read, write};
use gleaner_units::{Cell, Degrees, GeoPoint};

const TEXT: &str = r#"terminal = [2, 1]
battery_units = 20.0

[grid]
corner_lat_deg = -35.3632621
corner_lon_deg = 149.1652374
cell_m = 20.0
heights = "city.csv"

[fence]
excluded = [[3, 0]]

[[device]]
id = 7
cell = [1, 1]
data = 6000.0

[[device]]
id = 9
lat_deg = -35.36317
lon_deg = 149.16568
data = 100.0
"#;

fn city(path: &str) -> Result<String, String> {
    assert_eq!(path, "city.csv");
    Ok("0,10,0,30\n1,2,3,4\n".into())
}

fn fails(text: &str) -> String {
    let error = read(text, city).unwrap_err().to_string();
    assert!(!error.contains('\n'), "one line: {error}");
    error
}

#[test]
fn a_mission_survives_writing_and_reading() {
    let mission = read(TEXT, city).unwrap();
    assert_eq!(mission.terminal, Cell::new(2, 1));
    assert_eq!(mission.pose.corner, GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 });
    assert_eq!(mission.heights.height_m(Cell::new(0, 0)), Some(1));
    assert_eq!(mission.fence.len(), 7);
    assert_eq!(mission.devices[0], DeviceSite { id: 7, cell: Cell::new(1, 1), data: 6000.0 });
    assert_eq!(mission.devices[1].cell, Cell::new(2, 0), "from latitude and longitude");
    let text = write(&mission, "city.csv");
    assert_eq!(read(&text, city).unwrap(), mission, "{text}");
}

/// Buildings of up to 30 m, on ground that rises by 50 m to the west.
#[test]
fn uneven_ground_raises_the_highest_roof() {
    let tables = |path: &str| match path {
        "ground.csv" => Ok("60,50,20,10\n50,40,20,10\n".into()),
        _ => city(path),
    };
    let with = |keys: &str| TEXT.replace("cell_m =", &format!("{keys}\ncell_m ="));
    let ground = "ground = \"ground.csv\"\ntake_off_ground_m";
    let mission = read(&with(&format!("{ground} = 9.5")), tables).unwrap();
    assert_eq!(mission.heights.highest().0, 51.0, "60 m, less 9.5 m, rounded up");
    assert_eq!(mission.heights.tallest().0, 30.0);
    let text = write(&mission, "city.csv");
    assert_eq!(read(&text, city).unwrap(), mission, "{text}");
    assert_eq!(read(&with("highest_m = 51"), city).unwrap(), mission);
    assert_eq!(read(TEXT, city).unwrap().heights.highest().0, 30.0);
    let fault = |keys: &str| read(&with(keys), tables).unwrap_err().to_string();
    assert!(fault("ground = \"ground.csv\"").contains("ground without take_off_ground_m"));
    assert!(fault("take_off_ground_m = 1.0").contains("take_off_ground_m without ground"));
    assert!(fault(&format!("{ground} = 1.0\nhighest_m = 4")).contains("highest_m beside ground"));
    assert!(fault(&format!("{ground} = nan")).contains("ground without take_off_ground_m"));
}

#[test]
fn rotated_grids_survive_writing_and_place_devices() {
    let rotated = |degrees: &str| TEXT.replace("cell_m =", &format!("rotation_deg = {degrees}\ncell_m ="));
    let mission = read(&rotated("0.0"), city).unwrap();
    assert_eq!(mission, read(TEXT, city).unwrap(), "0 is the default");
    // The north axis points east, and the east axis south.
    let east =
        TEXT.replace("lat_deg = -35.36317\nlon_deg = 149.16568", "lat_deg = -35.36335\nlon_deg = 149.16555");
    let east = east.replace("cell_m =", "rotation_deg = 90.0\ncell_m =");
    let mission = read(&east, city).unwrap();
    assert_eq!(mission.pose.rotation, Degrees(90.0));
    assert_eq!(mission.devices[1].cell, Cell::new(0, 1), "28 m east and 10 m south of the corner");
    let text = write(&mission, "city.csv");
    assert_eq!(read(&text, city).unwrap(), mission, "{text}");
    assert_eq!(
        fails(&rotated("200.0")),
        "line 7: rotation_deg is not from -180 to 180: give the clockwise angle from north"
    );
}

#[test]
fn faults_name_the_line_and_say_what_to_do() {
    assert_eq!(
        fails(&TEXT.replace("id = 9", "id = 7")),
        "line 18: device 7 is already in line 13: correct one of the ids"
    );
    assert_eq!(
        fails(&TEXT.replace("cell = [1, 1]", "cell = [9, 1]")),
        "line 13: device 7 stands outside the city: correct this device"
    );
    assert_eq!(
        fails(&TEXT.replace("cell = [1, 1]\n", "")),
        "line 13: device 7: give either cell = [x, y] or lat_deg and lon_deg"
    );
    assert_eq!(
        fails(&TEXT.replace("[2, 1]", "[3, 0]")),
        "line 1: the terminal cell is outside the fence: move the terminal or widen the fence"
    );
    assert_eq!(
        fails(&TEXT.replace("20.0\n\n[grid]", "nan\n\n[grid]")),
        "line 2: battery_units is not a number above 0: give one"
    );
    assert_eq!(fails(&TEXT.replace("-35.3632621", "nan")), "line 5: not an angle from -90 to 90 degrees");
    assert_eq!(
        fails(&TEXT.replace("cell_m = 20.0", "cell_m = -1.0")),
        "line 7: cell_m is not a length above 0: give the side in metres"
    );
    assert_eq!(
        fails(&TEXT.replace("[[3, 0]]", "[[4, 0]]")),
        "line 11: cell (4, 0) is outside the 4 x 2 grid"
    );
    assert!(fails(&TEXT.replace("cell_m", "cell_metres")).starts_with("line 7: unknown field `cell_metres`"));
    assert!(fails("terminal = [1").starts_with("line 1: "));
    assert!(fails(&TEXT.replace("data = 6000.0\n", "")).starts_with("line 13: missing field `data`"));
}

#[test]
fn devices_are_named_by_32_bit_ids_and_lorawan_addresses() {
    for name in
        ["id = 0x26011BDA", "id = \"26011BDA\"", "dev_addr = \"26011bda\"", "dev_eui = \"70B3D57E26011BDA\""]
    {
        let mission = read(&TEXT.replace("id = 9", name), city).unwrap();
        assert_eq!(mission.devices[1].id, 0x2601_1BDA, "{name}");
    }
    assert_eq!(
        fails(&TEXT.replace("id = 9", "dev_addr = \"2601\"")),
        "line 18: a device address has 8 hexadecimal digits, such as \"26011BDA\""
    );
    assert_eq!(
        fails(&TEXT.replace("id = 9", "id = 9\ndev_addr = \"26011BDA\"")),
        "line 18: a device has either id, dev_addr or dev_eui: give one of them"
    );
}

#[test]
fn the_city_is_asked_for_by_its_path_and_its_faults_are_passed_on() {
    let missing = read(TEXT, |_| Err("no such file".into())).unwrap_err();
    assert_eq!(missing.to_string(), "line 8: heights \"city.csv\": no such file");
    let wrong = read(TEXT, |_| Ok("1,x\n".into())).unwrap_err();
    assert_eq!(wrong.to_string(), "heights \"city.csv\", line 1, column 2: \"x\" is no height in metres");
}

#[test]
fn without_a_fence_all_of_the_grid_may_be_flown_over() {
    let text = TEXT.replace("[fence]\nexcluded = [[3, 0]]\n", "");
    assert_eq!(read(&text, city).unwrap().fence.len(), 8);
    let rectangle = TEXT.replace("excluded = [[3, 0]]", "allowed = [[1, 0], [2, 1]]");
    assert_eq!(read(&rectangle, city).unwrap().fence.len(), 4);
}

#[test]
fn a_terminal_on_a_building_needs_its_height_stated() {
    let roof = TEXT.replace("[2, 1]", "[1, 1]");
    assert_eq!(
        fails(&roof),
        "line 1: the terminal (1, 1) is on a building of 10 m, where the aircraft would land: move it, or write terminal_height_m = 10"
    );
    let stated = |height: &str| format!("terminal_height_m = {height}\n{roof}");
    let mission = read(&stated("10"), city).unwrap();
    assert_eq!(read(&write(&mission, "city.csv"), city).unwrap(), mission);
    assert_eq!(
        fails(&stated("12.0")),
        "line 1: terminal_height_m = 12, but the city has 10 m at (1, 1): correct one of them"
    );
    assert!(read(&format!("terminal_height_m = 0.0\n{TEXT}"), city).is_ok());
}

#[test]
fn a_place_outside_the_city_gets_distance_and_likely_cause() {
    let place = |lat: &str, lon: &str| {
        let text = TEXT.replace(
            "lat_deg = -35.36317\nlon_deg = 149.16568",
            &format!("lat_deg = {lat}\nlon_deg = {lon}"),
        );
        fails(&text)
    };
    for (lat, lon, expected) in [
        ("149.16568", "-35.36317", "lat_deg = 149.16568, lon_deg = -35.36317 are no place: they are swapped"),
        (
            "35.36317",
            "149.16568",
            "stands outside the city, 7864 km from its corner: lat_deg has the wrong sign",
        ),
        ("-35.36317", "-149.16568", "km from its corner: lon_deg has the wrong sign"),
        ("35.36317", "-149.16568", "km from its corner: both have the wrong sign"),
        (
            "-36.36317",
            "149.16568",
            "111 km from its corner: correct lat_deg and lon_deg, or the grid's corner",
        ),
        ("-35.3642621", "149.16568", "118 m from its corner: move it, or enlarge the city"),
        ("-35,36317", "149.16568", "line 20: a decimal comma: write a point"),
    ] {
        let error = place(lat, lon);
        assert!(error.ends_with(expected), "{error}");
    }
}
