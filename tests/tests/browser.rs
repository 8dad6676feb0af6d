//! The page in a real browser. Chromium opens the live page of a simulated flight, engages, changes the preference,
//! sees a take-over and a restart of the program; then it opens a finished flight and a mission from their files.
//!
//! Run it alone, after the programs are built, with
//! `cargo test --release --workspace --test browser -- --nocapture`.

use gleaner_tests::programs::path;
use gleaner_tests::python;
use serde_json::Value;

/// Largest page, bytes: a phone at the field loads it over a slow link.
const PAGE_BYTES_MAX: u64 = 500_000;

#[test]
fn a_browser_flies_with_the_page() {
    let (sitl, gleaner) = (path("gleaner-sitl"), path("gleaner"));
    let seen = python::run("browser.py", [&sitl, &gleaner]).unwrap_or_else(|cause| panic!("{cause:#}"));
    let seen: Value = serde_json::from_str(seen.lines().last().expect("a line")).unwrap();
    println!("{seen:#}");
    for page in ["live_bytes", "flight_bytes", "mission_bytes"] {
        let bytes = seen[page].as_u64().unwrap();
        assert!(bytes < PAGE_BYTES_MAX, "{page}: {bytes}");
    }
}
