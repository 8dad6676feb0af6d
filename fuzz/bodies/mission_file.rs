//! Arbitrary text as a mission file: nothing panics, an error is one line, and an accepted mission is sound and survives
//! writing and reading.

use gleaner_pilot::mission_file;

/// A city of 4 x 3 cells.
const CITY: &str = "0,10,0,0\n0,0,20,0\n0,0,0,0\n";

pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match mission_file::read(text, |_| Ok(CITY.into())) {
        Ok(mission) => {
            mission.check().expect("an accepted mission is sound");
            let written = mission_file::write(&mission, "city.csv");
            let again =
                mission_file::read(&written, |_| Ok(CITY.into())).expect("what is written can be read");
            assert_eq!(again.devices, mission.devices);
        }
        Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
    }
}
