//! The live page in a real browser: Chromium opens it, engages, turns the preference, sees a take-over and a restart.
//!
//! Run it alone, after the programs are built, with
//! `cargo test --release --workspace --test browser -- --nocapture`.

use gleaner_tests::programs::path;
use gleaner_tests::python;
use serde_json::Value;

/// Largest page, bytes: a phone at the field loads it over a slow link.
const PAGE_BYTES_MAX: u64 = 500_000;

#[test]
fn a_person_flies_with_the_page() {
    let program = path("gleaner-sitl");
    let seen = python::run("browser.py", &[program.as_os_str()]).unwrap();
    let seen: Value = serde_json::from_str(&seen).unwrap();
    println!("{seen:#}");
    assert!(seen["weight_bytes"].as_u64().unwrap() < PAGE_BYTES_MAX);
}
