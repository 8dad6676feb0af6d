//! Arbitrary bytes as a city file: nothing panics, and an error is one line.

use gleaner_units::Metres;
use gleaner_units::city_file::read_city;

pub fn run(data: &[u8]) {
    if let Err(error) = read_city(data, Metres(20.0)) {
        assert_eq!(error.to_string().lines().count(), 1, "{error}");
    }
}
