//! Building heights of the cells, and their CSV format.

use crate::{Cell, Grid, GridError, MAX_CELLS, Metres};
use core::fmt;

/// Building heights of a grid in whole metres, 0 for open ground. One byte a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightMap {
    grid: Grid,
    heights_m: [u8; MAX_CELLS],
    /// See [`HeightMap::highest`]; `None` on flat ground.
    highest_m: Option<u16>,
}

/// A fault in a city file. Line and column count from 1; a column is a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CsvError {
    /// Line of the text.
    pub line: usize,
    /// Value in the line.
    pub column: usize,
    /// The fault.
    pub fault: CsvFault,
}

/// Faults of a city file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CsvFault {
    /// Not a whole number of metres from 0 to 255.
    Height,
    /// The row has another number of values than the first.
    RowLength,
    /// The grid is invalid.
    Grid(GridError),
}

impl fmt::Display for CsvError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, value {}: ", self.line, self.column)?;
        match self.fault {
            CsvFault::Height => write!(f, "not a whole number of metres from 0 to 255"),
            CsvFault::RowLength => write!(f, "the row is not as long as the first"),
            CsvFault::Grid(error) => write!(f, "{error}"),
        }
    }
}

impl core::error::Error for CsvError {}

impl HeightMap {
    /// A city without buildings.
    #[must_use]
    pub const fn flat(grid: Grid) -> HeightMap {
        HeightMap { grid, heights_m: [0; MAX_CELLS], highest_m: None }
    }

    /// Reads a city file: heights in whole metres, one row a line from north to south, columns from west to
    /// east, separated by commas. Empty lines and lines that begin with `#` are skipped.
    ///
    /// # Errors
    /// The first fault, see [`CsvError`].
    pub fn from_csv(text: &str, cell: Metres) -> Result<HeightMap, CsvError> {
        let rows = || {
            text.lines()
                .enumerate()
                .map(|(index, line)| (index + 1, line.trim()))
                .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        };
        let height = rows().count();
        let width = rows().next().map_or(0, |(_, line)| line.split(',').count());
        let side = |count: usize| u16::try_from(count).unwrap_or(u16::MAX);
        let grid = Grid::new(side(width), side(height), cell).map_err(|error| CsvError {
            line: 1,
            column: 1,
            fault: CsvFault::Grid(error),
        })?;
        let mut map = HeightMap::flat(grid);
        for (row, (line, text)) in rows().enumerate() {
            let mut columns = 0;
            for (column, value) in text.split(',').enumerate() {
                let fault = |fault| CsvError { line, column: column + 1, fault };
                let height_m = value.trim().parse::<u8>().map_err(|_| fault(CsvFault::Height))?;
                if column >= width {
                    return Err(fault(CsvFault::RowLength));
                }
                map.set(Cell::new(column as i16, (height - 1 - row) as i16), height_m);
                columns = column + 1;
            }
            if columns != width {
                return Err(CsvError { line, column: columns, fault: CsvFault::RowLength });
            }
        }
        Ok(map)
    }

    /// The grid that the heights cover.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// The height of the building on this cell, 0 for open ground; `None` outside the grid.
    #[must_use]
    pub fn height(&self, cell: Cell) -> Option<Metres> {
        self.height_m(cell).map(|height_m| Metres(f32::from(height_m)))
    }

    /// [`HeightMap::height`] in whole metres.
    #[must_use]
    pub fn height_m(&self, cell: Cell) -> Option<u8> {
        self.grid.index(cell).and_then(|index| self.heights_m.get(index)).copied()
    }

    /// Sets the height of a cell in whole metres; no effect outside the grid.
    pub fn set(&mut self, cell: Cell, height_m: u8) {
        if let Some(slot) = self.grid.index(cell).and_then(|index| self.heights_m.get_mut(index)) {
            *slot = height_m;
        }
    }

    /// The heights in index order: row-major from the south-west corner.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.heights_m.get(..self.grid.len()).unwrap_or(&[])
    }

    /// Height of the tallest building above its ground.
    #[must_use]
    pub fn tallest(&self) -> Metres {
        Metres(f32::from(self.as_slice().iter().copied().max().unwrap_or(0)))
    }

    /// The highest roof or hill above the take-off point. On flat ground, as long as nothing else is stated, the tallest
    /// building.
    #[must_use]
    pub fn highest(&self) -> Metres {
        self.highest_m.map_or_else(|| self.tallest(), |height_m| Metres(f32::from(height_m)))
    }

    /// The stated height of [`HeightMap::highest`] in whole metres.
    #[must_use]
    pub const fn stated_highest_m(&self) -> Option<u16> {
        self.highest_m
    }

    /// States [`HeightMap::highest`], where the ground is not flat.
    pub const fn set_highest(&mut self, height_m: u16) {
        self.highest_m = Some(height_m);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_row_of_the_file_is_the_northernmost() {
        let map = HeightMap::from_csv("# city\n1,2,3\n\n4,5,6\n", Metres(20.0)).unwrap();
        assert_eq!(map.as_slice(), [4, 5, 6, 1, 2, 3]);
        assert_eq!(map.height(Cell::new(2, 1)), Some(Metres(3.0)));
        assert_eq!(map.height(Cell::new(3, 0)), None);
        assert_eq!(map.tallest(), Metres(6.0));
    }

    #[test]
    fn errors_contain_line_and_column() {
        let fault = |text: &str| HeightMap::from_csv(text, Metres(20.0)).unwrap_err();
        assert_eq!(fault("1,2\n3,x\n"), CsvError { line: 2, column: 2, fault: CsvFault::Height });
        assert_eq!(fault("1,2\n3\n"), CsvError { line: 2, column: 1, fault: CsvFault::RowLength });
        assert_eq!(fault("1,2\n3,4,5\n"), CsvError { line: 2, column: 3, fault: CsvFault::RowLength });
        assert_eq!(fault("1,256\n"), CsvError { line: 1, column: 2, fault: CsvFault::Height });
        assert_eq!(fault("").fault, CsvFault::Grid(GridError::Empty));
    }
}
