//! Differences between the world and what the aircraft assumes: channel, map and reports.

use crate::env::flight::Flight;
use gleaner_units::{Cell, Db, HeightMap};
use gleaner_world::{Channel, City, Fading, Seed, Stream, World};
use rand::{Rng, RngExt};
use std::sync::Arc;

/// The largest height of a building on a map with wrong heights, m: below flight altitude.
const HEIGHT_MAX_M: i16 = 55;
/// Largest error of the noise level in training, dB.
const NOISE_ERROR_DB: f32 = 6.0;
/// Largest error of the path-loss exponents in training.
const EXPONENT_ERROR: f32 = 0.3;

/// The error of the map on board.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum MapError {
    /// None.
    #[default]
    None,
    /// No buildings on the map.
    Flat,
    /// Each built cell is missing with this probability.
    Missing(f64),
    /// Each building is higher or lower by this many metres, with equal probability.
    Heights(u8),
}

/// How the world differs from what the aircraft assumes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mismatch {
    /// The noise is stronger by this, dB.
    pub noise_db: f32,
    /// Both path-loss exponents are larger by this.
    pub exponent: f32,
    /// Fading on every link.
    pub fading: Fading,
    /// The error of the map.
    pub map: MapError,
    /// Share of the reports that do not arrive.
    pub missing_reports: f64,
}

impl Mismatch {
    /// A difference to train with: noise off by up to 6 dB or exponents by up to 0.3, in half of them with a map that lacks
    /// a tenth of the buildings, that has wrong heights, or that is missing.
    #[must_use]
    pub fn draw(rng: &mut impl Rng) -> Mismatch {
        let (mut noise_db, mut exponent) = (0.0, 0.0);
        if rng.random() {
            noise_db = rng.random_range(-NOISE_ERROR_DB..=NOISE_ERROR_DB);
        } else {
            exponent = rng.random_range(-EXPONENT_ERROR..=EXPONENT_ERROR);
        }
        let map = match rng.random_range(0..6) {
            0 => MapError::Missing(0.1),
            1 => MapError::Heights(10),
            2 => MapError::Flat,
            _ => MapError::None,
        };
        Mismatch { noise_db, exponent, map, ..Mismatch::default() }
    }

    /// Whether the channel is the nominal one; map and reports may still be wrong.
    #[must_use]
    pub fn channel_is_nominal(&self) -> bool {
        self.noise_db == 0.0 && self.exponent == 0.0 && self.fading == Fading::None
    }

    /// The world that is flown in.
    #[must_use]
    pub fn world(&self, city: City) -> World {
        let mut channel = Channel { fading: self.fading, ..Channel::default() };
        channel.noise = channel.noise + Db(self.noise_db);
        channel.line_of_sight.exponent += self.exponent;
        channel.obstructed.exponent += self.exponent;
        World::new(city, channel)
    }

    /// The map on board, where it differs from the city. `seed` fixes the random draws of its errors.
    ///
    /// # Panics
    /// Never: buildings stay below flight altitude, and open cells stay open.
    #[must_use]
    pub fn map(&self, city: &City, seed: Seed) -> Option<Arc<City>> {
        let mut rng = seed.rng(Stream::Choices);
        let grid = city.grid();
        let mut heights: HeightMap = city.heights().clone();
        let built: Vec<Cell> = grid.cells().filter(|&cell| !city.is_open(cell)).collect();
        for cell in built {
            let height_m = i16::from(city.heights().height_m(cell).unwrap_or(0));
            let mapped_m = match self.map {
                MapError::None => return None,
                MapError::Flat => 0,
                MapError::Missing(share) => {
                    if rng.random_bool(share) {
                        0
                    } else {
                        height_m
                    }
                }
                MapError::Heights(by) => {
                    let by = if rng.random() { i16::from(by) } else { -i16::from(by) };
                    (height_m + by).clamp(1, HEIGHT_MAX_M)
                }
            };
            heights.set(cell, mapped_m as u8);
        }
        Some(Arc::new(City::new(heights).expect("buildings are low and open cells stay open")))
    }

    /// The flight with its map and its missing reports.
    #[must_use]
    pub fn prepare(&self, flight: Flight, map: Option<&Arc<City>>, seed: Seed) -> Flight {
        let flight = flight.with_reports_missing(self.missing_reports, seed);
        match map {
            Some(map) => flight.with_map(Arc::clone(map)),
            None => flight,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn map_errors_keep_open_cells_open() {
        let city = City::default_city();
        let map = |map| Mismatch { map, ..Mismatch::default() }.map(&city, Seed::evaluation(0));
        assert!(map(MapError::None).is_none());
        assert_eq!(map(MapError::Flat).unwrap().open_cells().len(), city.grid().len());
        let missing = map(MapError::Missing(0.1)).unwrap();
        let more = missing.open_cells().len() - city.open_cells().len();
        assert!((20..90).contains(&more), "{more} of 494 built cells are missing");
        let heights = map(MapError::Heights(10)).unwrap();
        assert_eq!(heights.open_cells(), city.open_cells());
        assert_ne!(heights.heights(), city.heights());
    }

    #[test]
    fn noise_and_exponents_lower_the_mean_snr() {
        let world = |mismatch: Mismatch| mismatch.world(City::default_city());
        let (near, far) = (Cell::new(20, 15), Cell::new(25, 3));
        let snr = |world: &World| world.mean_snr(near, far).unwrap().0;
        let nominal = snr(&world(Mismatch::default()));
        let noise = snr(&world(Mismatch { noise_db: 6.0, ..Mismatch::default() }));
        assert!((nominal - noise - 6.0).abs() < 1e-3);
        assert!(snr(&world(Mismatch { exponent: 0.3, ..Mismatch::default() })) < nominal - 6.0);
    }
}
