//! A city: building heights and line of sight.

use crate::generator;
use crate::mirror::Mirror;
use crate::sight::SightTable;
use core::fmt::Write;
use gleaner_units::{Cell, CsvError, Grid, HeightMap, Metres, Sight};
use thiserror::Error;

/// Building heights, and which open cell has line of sight to which cell at flight altitude.
#[derive(Clone, Debug, PartialEq)]
pub struct City {
    heights: HeightMap,
    open_cells: Vec<Cell>,
    sight: SightTable,
}

/// Why a map cannot be a city.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum CityError {
    /// The text is not a height map.
    #[error("the city file cannot be read: {0}")]
    Csv(#[from] CsvError),
    /// A building reaches flight altitude; the paper asks for h > H.
    #[error(
        "a building of {tallest_m} m reaches the flight altitude of {altitude_m} m: lower it or cap the heights"
    )]
    TooTall {
        /// The tallest building.
        tallest_m: u8,
        /// Flight altitude.
        altitude_m: u16,
    },
    /// All cells are built, so no device has a place.
    #[error("every cell carries a building: leave open ground for the devices")]
    NoOpenCell,
}

impl City {
    /// Flight altitude above the ground, m (paper, table of simulation parameters).
    pub const ALTITUDE_M: u16 = 60;
    /// The side of a cell in the cities made here (paper, same table).
    pub const CELL: Metres = Metres(20.0);

    /// A city with these heights.
    ///
    /// # Errors
    /// See [`CityError`].
    ///
    /// # Cost
    /// Decides line of sight for every pair of an open cell and a cell: tens of milliseconds for 40 x 30 cells.
    pub fn new(heights: HeightMap) -> Result<City, CityError> {
        let tallest_m = heights.as_slice().iter().copied().max().unwrap_or(0);
        if u16::from(tallest_m) >= City::ALTITUDE_M {
            return Err(CityError::TooTall { tallest_m, altitude_m: City::ALTITUDE_M });
        }
        let open_cells: Vec<Cell> =
            heights.grid().cells().filter(|&cell| heights.height_m(cell) == Some(0)).collect();
        if open_cells.is_empty() {
            return Err(CityError::NoOpenCell);
        }
        let sight = SightTable::new(&heights, City::ALTITUDE_M);
        Ok(City { heights, open_cells, sight })
    }

    /// Reads a city file with cells of 20 m; the form is that of [`HeightMap::from_csv`].
    ///
    /// # Errors
    /// See [`CityError`].
    pub fn from_csv(text: &str) -> Result<City, CityError> {
        City::new(HeightMap::from_csv(text, City::CELL)?)
    }

    /// The city that the shipped policies are trained in: 40 x 30 cells, 41 % built.
    #[must_use]
    pub fn default_city() -> City {
        City::from_csv(include_str!("../cities/default.csv")).expect("the file is compiled in and tested")
    }

    /// A random city of 40 x 30 cells: blocks of 3 to 6 cells, streets of 1, 2, 1, 3 cells, lots split at random, one
    /// lot in eight empty, heights 6 m plus an exponential of mean 15 m, at most 50 m.
    #[must_use]
    pub fn generate(seed: u64) -> City {
        City::new(generator::heights(seed, City::CELL)).expect("streets are open and heights are capped")
    }

    /// The mirror image of this city.
    #[must_use]
    pub fn mirrored(&self, mirror: Mirror) -> City {
        City::new(mirror.heights(&self.heights)).expect("a mirror image of a city is a city")
    }

    /// The grid of cells.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.heights.grid()
    }

    /// Building heights.
    #[must_use]
    pub const fn heights(&self) -> &HeightMap {
        &self.heights
    }

    /// The cells without a building, in index order: where devices may be.
    #[must_use]
    pub fn open_cells(&self) -> &[Cell] {
        &self.open_cells
    }

    /// Whether the cell is in the city and has no building.
    #[must_use]
    pub fn is_open(&self, cell: Cell) -> bool {
        self.heights.height_m(cell) == Some(0)
    }

    /// Whether there is line of sight between a device on the open cell `device` and an aircraft at flight altitude over
    /// `uav`, both at the centres of their cells. `false` for a device on a building or a cell outside the city.
    #[must_use]
    pub fn line_of_sight(&self, device: Cell, uav: Cell) -> bool {
        match (self.sight.row(device), self.grid().index(uav)) {
            (Some(row), Some(index)) => self.sight.sees(row, index),
            _ => false,
        }
    }

    pub(crate) const fn sight(&self) -> &SightTable {
        &self.sight
    }

    /// A hash of grid, altitude and heights (64-bit FNV-1a) for the metadata of models. Printed as 16 hexadecimal digits.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let grid = self.grid();
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut eat = |bytes: &[u8]| {
            for &byte in bytes {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
            }
        };
        eat(&grid.width().to_le_bytes());
        eat(&grid.height().to_le_bytes());
        eat(&grid.cell().0.to_le_bytes());
        eat(&City::ALTITUDE_M.to_le_bytes());
        eat(self.heights.as_slice());
        hash
    }

    /// The city file: what [`City::from_csv`] reads.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let grid = self.grid();
        let mut text = format!(
            "# building heights in metres, {} columns west to east, {} rows north to south (first row = northernmost), cell {} m\n",
            grid.width(),
            grid.height(),
            grid.cell().0
        );
        for row in self.heights.as_slice().chunks(usize::from(grid.width())).rev() {
            let mut separator = "";
            for height_m in row {
                write!(text, "{separator}{height_m}").expect("writing to a string cannot fail");
                separator = ",";
            }
            text.push('\n');
        }
        text
    }
}

impl Sight for City {
    fn grid(&self) -> Grid {
        City::grid(self)
    }

    fn altitude(&self) -> Metres {
        Metres(f32::from(City::ALTITUDE_M))
    }

    fn sees(&self, ground: Cell, air: Cell) -> bool {
        self.line_of_sight(ground, air)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_city_has_the_documented_size() {
        let city = City::default_city();
        assert_eq!((city.grid().width(), city.grid().height()), (40, 30));
        assert_eq!(city.open_cells().len(), 706);
        assert_eq!(city.heights().tallest(), Metres(50.0));
        assert!(city.open_cells().iter().all(|&cell| city.is_open(cell)));
    }

    #[test]
    fn the_city_file_survives_a_round_trip() {
        for city in [City::default_city(), City::generate(7)] {
            assert_eq!(City::from_csv(&city.to_csv()).unwrap(), city);
        }
        assert!(City::default_city().to_csv() == include_str!("../cities/default.csv"));
    }

    #[test]
    fn fingerprints_differ_between_cities() {
        let city = City::default_city();
        let mut all: Vec<u64> = Mirror::ALL.map(|mirror| city.mirrored(mirror).fingerprint()).to_vec();
        all.extend((0..10).map(|seed| City::generate(seed).fingerprint()));
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
    }

    #[test]
    fn impossible_cities_are_refused() {
        assert_eq!(City::from_csv("0,60\n"), Err(CityError::TooTall { tallest_m: 60, altitude_m: 60 }));
        assert_eq!(City::from_csv("1,2\n3,4\n"), Err(CityError::NoOpenCell));
        assert!(matches!(City::from_csv("1,x\n"), Err(CityError::Csv(_))));
        assert!(City::from_csv("0,59\n").is_ok());
    }
}
