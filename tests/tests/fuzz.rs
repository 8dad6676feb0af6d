//! The bodies of the fuzz targets, on bounded, seeded inputs: random bytes, and valid frames that are then damaged.

use gleaner_radio::{Report, encode};
use gleaner_units::Db;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[path = "../../fuzz/bodies/mavlink_stream.rs"]
mod mavlink_stream;
#[path = "../../fuzz/bodies/radio_frame.rs"]
mod radio_frame;

const INPUTS: u64 = 3_000;

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
