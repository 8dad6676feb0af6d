//! A small part of the sweep, flown again and compared with its snapshot.
//!
//! A snapshot changes only when a flight ends differently. After a change that is meant, write it again:
//! `gleaner-sitl sweep --first 50000 --flights 60 --autopilot-kind KIND --table
//! sitl/harness/snapshots/sweep-KIND-60.txt`.

use std::process::Command;

fn compare(kind: &str, snapshot: &str) {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("table.txt");
    let output = Command::new(env!("CARGO_BIN_EXE_gleaner-sitl"))
        .args(["sweep", "--first", "50000", "--flights", "60", "--autopilot-kind", kind, "--table"])
        .arg(&table)
        .arg("--out")
        .arg(folder.path())
        .output()
        .unwrap();
    let report = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{report}");
    assert_eq!(std::fs::read_to_string(&table).unwrap(), snapshot, "{report}");
}

#[test]
fn sixty_flights_with_ardupilot_end_as_in_the_snapshot() {
    compare("ardupilot", include_str!("../snapshots/sweep-ardupilot-60.txt"));
}

#[test]
fn sixty_flights_with_px4_end_as_in_the_snapshot() {
    compare("px4", include_str!("../snapshots/sweep-px4-60.txt"));
}
