//! `gleaner params`: what a ground station will see.

mod fixture;

use fixture::{Fixture, outcome};
use gleaner_link::PARAMETERS;

#[test]
fn every_parameter_is_listed_with_the_configured_value() {
    let fixture = Fixture::new();
    let (code, stdout, stderr) = outcome(&fixture.gleaner("params").output().unwrap());
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    let rows: Vec<Vec<&str>> = stdout.lines().skip(1).map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(rows.len(), PARAMETERS.len());
    assert_eq!(rows[0][..4], ["GLN_W_DATA", "0.25", "0.5", "0..1"], "{stdout}");
    for (row, spec) in rows.iter().zip(PARAMETERS).skip(1) {
        assert_eq!(row[0], spec.name);
        // The board's default is 0; a computer looks ahead.
        let default = if spec.name == "GLN_LOOKAHEAD" { 1.0 } else { spec.default };
        assert_eq!((row[1], row[2]), (row[2], default.to_string().as_str()), "{stdout}");
    }
}

#[test]
fn a_value_out_of_its_range_is_one_line_with_its_place() {
    let fixture = Fixture::new();
    fixture.edit("gleaner.toml", "GLN_W_DATA = 0.25", "GLN_W_DATA = 25");
    let (code, stdout, stderr) = outcome(&fixture.gleaner("params").output().unwrap());
    assert_eq!((code, stdout.as_str(), stderr.lines().count()), (Some(2), "", 1), "{stderr}");
    assert!(stderr.contains("gleaner.toml") && stderr.contains("GLN_W_DATA must be 0..1"), "{stderr}");
}
