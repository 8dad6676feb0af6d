//! Line of sight from the ground to flight altitude.

use gleaner_units::{Cell, Grid, HeightMap, Rays, Sight};

/// Cities with more cells have no table: it would take minutes and dozens of megabytes.
const TABLE_CELLS: usize = 4096;
const NO_ROW: u32 = u32::MAX;

/// Line of sight between open cells and cells at flight altitude.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SightTable {
    grid: Grid,
    /// By grid index: the cell's row, or [`NO_ROW`] for a built cell.
    rows: Vec<u32>,
    pairs: Pairs,
}

/// The answer for a row and a cell at flight altitude.
#[derive(Clone, Debug, PartialEq)]
enum Pairs {
    /// One bit for each pair. The rows are the open cells.
    Table { words_per_row: usize, bits: Vec<u64> },
    /// One ray for each question. The rows are the grid's indices.
    Rays { heights: Box<HeightMap>, altitude_m: u16 },
}

impl SightTable {
    /// # Cost
    /// One ray for each pair of an open cell and a cell, 0.85 million in the default city; none for a city of more than
    /// [`TABLE_CELLS`] cells, where each question costs one.
    pub(crate) fn new(heights: &HeightMap, altitude_m: u16) -> SightTable {
        let grid = heights.grid();
        let open = || grid.cells().enumerate().filter(|&(_, cell)| heights.height_m(cell) == Some(0));
        let mut rows = vec![NO_ROW; grid.len()];
        if grid.len() > TABLE_CELLS {
            for (index, _) in open() {
                rows[index] = index as u32;
            }
            let pairs = Pairs::Rays { heights: Box::new(heights.clone()), altitude_m };
            return SightTable { grid, rows, pairs };
        }
        let rays = Rays { heights, altitude_m };
        let words_per_row = grid.len().div_ceil(64);
        let mut bits = Vec::new();
        for (row, (index, device)) in (0..).zip(open()) {
            rows[index] = row;
            let begin = bits.len();
            bits.resize(begin + words_per_row, 0);
            for (column, uav) in grid.cells().enumerate() {
                if rays.sees(device, uav) {
                    bits[begin + column / 64] |= 1 << (column % 64);
                }
            }
        }
        SightTable { grid, rows, pairs: Pairs::Table { words_per_row, bits } }
    }

    /// The row of an open cell; `None` for a built cell and outside the grid.
    pub(crate) fn row(&self, device: Cell) -> Option<u32> {
        self.grid.index(device).map(|index| self.rows[index]).filter(|&row| row != NO_ROW)
    }

    /// Whether there is line of sight between the open cell with this row and the cell with index `uav`.
    pub(crate) fn sees(&self, row: u32, uav: usize) -> bool {
        match &self.pairs {
            Pairs::Table { words_per_row, bits } => {
                bits[row as usize * words_per_row + uav / 64] & (1 << (uav % 64)) != 0
            }
            Pairs::Rays { heights, altitude_m } => {
                let ends = (self.grid.cell_at(row as usize), self.grid.cell_at(uav));
                let (Some(device), Some(uav)) = ends else { return false };
                Rays { heights, altitude_m: *altitude_m }.sees(device, uav)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::Metres;

    #[test]
    fn open_cells_have_a_row_and_built_ones_have_none() {
        let map = HeightMap::from_csv("50,50,50\n50,0,50\n50,50,50\n", Metres(20.0)).unwrap();
        let table = SightTable::new(&map, 60);
        assert_eq!(table.row(Cell::new(1, 1)), Some(0));
        assert_eq!(table.row(Cell::new(0, 1)), None);
        assert_eq!(table.row(Cell::new(3, 1)), None);
        let seen: Vec<usize> = (0..9).filter(|&uav| table.sees(0, uav)).collect();
        assert_eq!(seen, [4]);
    }

    #[test]
    fn a_city_without_a_table_gives_the_same_answers() {
        let height = |x: usize, y: usize| if (x * 7 + y * 3).is_multiple_of(5) { "40" } else { "0" };
        let row = |y: usize| (0..80).map(|x| height(x, y)).collect::<Vec<_>>().join(",");
        let rows: Vec<String> = (0..60).map(row).collect();
        let map = HeightMap::from_csv(&rows.join("\n"), Metres(20.0)).unwrap();
        let sight = SightTable::new(&map, 60);
        assert!(matches!(sight.pairs, Pairs::Rays { .. }));
        let rays = Rays { heights: &map, altitude_m: 60 };
        for (device, uav) in map.grid().cells().step_by(97).zip(map.grid().cells().skip(31).step_by(89)) {
            let index = map.grid().index(uav).unwrap();
            let sees = sight.row(device).map(|row| sight.sees(row, index));
            let open = map.height_m(device) == Some(0);
            assert_eq!(sees, open.then(|| rays.sees(device, uav)), "{device} {uav}");
        }
    }
}
