//! The bodies of the fuzz targets, on bounded, seeded inputs: random bytes, and valid frames that are then damaged.

use gleaner_radio::{Report, encode};
use gleaner_units::Db;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[path = "../../fuzz/bodies/city_file.rs"]
mod city_file;
#[path = "../../fuzz/bodies/decision_log.rs"]
mod decision_log;
#[path = "../../fuzz/bodies/mavlink_stream.rs"]
mod mavlink_stream;
#[path = "../../fuzz/bodies/mission_file.rs"]
mod mission_file;
#[path = "../../fuzz/bodies/mission_image.rs"]
mod mission_image;
#[path = "../../fuzz/bodies/model_blob.rs"]
mod model_blob;
#[path = "../../fuzz/bodies/onnx_file.rs"]
mod onnx_file;
#[path = "../../fuzz/bodies/parameter_store.rs"]
mod parameter_store;
#[path = "../../fuzz/bodies/radio_frame.rs"]
mod radio_frame;

const INPUTS: u64 = 3_000;
/// For files of hundreds of kilobytes.
const LARGE_INPUTS: u64 = 150;

/// The golden packets of the link crate.
fn packets() -> Vec<Vec<u8>> {
    let byte = |hex: &str, at: usize| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap();
    include_str!("../../firmware/link/tests/golden/packets.txt")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split_once(' ').unwrap().1)
        .map(|hex| (0..hex.len() / 2).map(|at| byte(hex, at)).collect())
        .collect()
}

fn reports() -> Vec<Vec<u8>> {
    let report = Report { device: 1, snr: Db(2.5), remaining: Some(0.0), age_ms: 0 };
    let impossible =
        Report { device: 2, snr: Db(f32::NAN), remaining: Some(f32::INFINITY), age_ms: u32::MAX };
    let semtech = [
        &[2, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0][..],
        br#"{"rxpk":[{"stat":1,"datr":"SF7BW125","lsnr":1,"data":"QNobASaAAQABqv8="}]}"#,
    ];
    vec![
        encode(&report).to_vec(),
        encode(&impossible).to_vec(),
        br#"{"id":1,"snr_db":1e39,"remaining":3e38,"age_s":-1}"#.to_vec(),
        br#"{"id":"26011BDA","snr_db":2.5,"remaining":0}"#.to_vec(),
        semtech.concat(),
    ]
}

/// Some of `valid` one after the other, with some bytes changed, or random bytes alone.
fn input(seed: u64, valid: &[Vec<u8>]) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut bytes = vec![0; rng.random_range(0..64)];
    rng.fill_bytes(&mut bytes);
    for _ in 0..rng.random_range(0..12) {
        bytes.extend_from_slice(&valid[rng.random_range(0..valid.len())]);
    }
    for _ in 0..rng.random_range(0..6) {
        if !bytes.is_empty() {
            let at = rng.random_range(0..bytes.len());
            bytes[at] ^= 1 << rng.random_range(0..8);
        }
    }
    bytes
}

/// One of `valid`, cut, with parts repeated or left out, and some bytes changed.
fn damaged(seed: u64, valid: &[Vec<u8>]) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut bytes = valid[rng.random_range(0..valid.len())].clone();
    for _ in 0..rng.random_range(0..4) {
        let (at, length) = (rng.random_range(0..bytes.len()), rng.random_range(1..40));
        let part = bytes[at..bytes.len().min(at + length)].to_vec();
        match rng.random_range(0..4) {
            0 => bytes.truncate(at.max(1)),
            1 => drop(bytes.splice(at..at + part.len(), [])),
            2 => drop(bytes.splice(at..at, part)),
            _ => bytes[at] = rng.random(),
        }
        if bytes.is_empty() {
            bytes.push(rng.random());
        }
    }
    bytes
}

fn file(path: &str) -> Vec<u8> {
    let path = gleaner_tests::programs::repository().join(path);
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The same file of several field inputs.
fn field_files<const N: usize>(cases: [&str; N], name: &str) -> Vec<Vec<u8>> {
    cases.map(|case| file(&format!("tests/field/{case}/{name}"))).to_vec()
}

/// A mission for the city of 4 x 3 cells that the target offers.
fn small_mission() -> gleaner_pilot::Mission {
    use gleaner_pilot::{DeviceSite, Mission};
    use gleaner_units::{BatteryUnits, Cell, CellSet, Degrees, GeoPoint, Grid, GridPose, HeightMap, Metres};
    let grid = Grid::new(4, 3, Metres(20.0)).unwrap();
    let corner = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };
    let site = DeviceSite { id: 7, cell: Cell::new(2, 1), data: 6000.0 };
    Mission {
        heights: HeightMap::flat(grid),
        fence: CellSet::full(grid),
        pose: GridPose { corner, rotation: Degrees(0.0) },
        terminal: Cell::new(0, 0),
        budget: BatteryUnits(30.0),
        devices: [site].into_iter().collect(),
    }
}

#[test]
fn model_blobs() {
    let valid = [file("models/gleaner.gln")];
    (0..LARGE_INPUTS).for_each(|seed| model_blob::run(&damaged(seed, &valid)));
}

#[test]
fn onnx_files() {
    let valid = [file("models/gleaner.onnx")];
    (0..LARGE_INPUTS).for_each(|seed| onnx_file::run(&damaged(seed, &valid)));
}

#[test]
fn mission_files() {
    let mut valid = field_files(
        ["01-geojson-osm", "09-toml-bom", "10-toml-crlf", "11-toml-utf16", "14-roofs"],
        "mission.toml",
    );
    valid.push(gleaner_pilot::mission_file::write(&small_mission(), "city.csv").into_bytes());
    (0..INPUTS).for_each(|seed| mission_file::run(&damaged(seed, &valid)));
}

#[test]
fn mission_images() {
    let valid = [gleaner_pilot::mission_image::encode(&small_mission()).to_vec()];
    (0..INPUTS).for_each(|seed| mission_image::run(&damaged(seed, &valid)));
}

#[test]
fn city_files() {
    let cases = [
        "03-excel-semicolon",
        "04-empty-cells",
        "05-lidar-decimals",
        "06-bom-csv",
        "07-trailing-commas",
        "08-nodata",
        "10-toml-crlf",
    ];
    let valid = field_files(cases, "city.csv");
    (0..INPUTS).for_each(|seed| city_file::run(&damaged(seed, &valid)));
}

#[test]
fn decision_logs() {
    let valid = [file("tests/data/decisions.jsonl")];
    (0..INPUTS).for_each(|seed| decision_log::run(&damaged(seed, &valid)));
}

#[test]
fn parameter_stores() {
    let valid = [vec![0xFF; 1024], vec![0; 1024], [*b"GLNP", [1, 0, 10, 0]].concat().repeat(100)];
    (0..INPUTS).for_each(|seed| parameter_store::run(&damaged(seed, &valid)));
}

#[test]
fn mavlink_streams() {
    let valid = packets();
    (0..INPUTS).for_each(|seed| mavlink_stream::run(&input(seed, &valid)));
}

#[test]
fn radio_frames() {
    let valid = reports();
    (0..INPUTS).for_each(|seed| radio_frame::run(&input(seed, &valid)));
}
