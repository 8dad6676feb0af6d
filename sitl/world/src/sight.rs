//! Line of sight from the ground to flight altitude, as a table.

use gleaner_units::{Cell, Grid, HeightMap, Rays, Sight};

/// Line of sight between open cells and cells at flight altitude: one bit for each pair.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SightTable {
    grid: Grid,
    /// By grid index: the cell's row, or [`NO_ROW`] for a built cell.
    rows: Vec<u32>,
    words_per_row: usize,
    bits: Vec<u64>,
}

const NO_ROW: u32 = u32::MAX;

impl SightTable {
    /// # Cost
    /// One ray for each pair of an open cell and a cell: 0.85 million in the default city.
    pub(crate) fn new(heights: &HeightMap, altitude_m: u16) -> SightTable {
        let grid = heights.grid();
        let rays = Rays { heights, altitude_m };
        let words_per_row = grid.len().div_ceil(64);
        let mut rows = vec![NO_ROW; grid.len()];
        let mut bits = Vec::new();
        let open = grid.cells().enumerate().filter(|&(_, cell)| heights.height_m(cell) == Some(0));
        for (row, (index, device)) in (0..).zip(open) {
            rows[index] = row;
            let begin = bits.len();
            bits.resize(begin + words_per_row, 0);
            for (column, uav) in grid.cells().enumerate() {
                if rays.sees(device, uav) {
                    bits[begin + column / 64] |= 1 << (column % 64);
                }
            }
        }
        SightTable { grid, rows, words_per_row, bits }
    }

    /// The row of an open cell; `None` for a built cell and outside the grid.
    pub(crate) fn row(&self, device: Cell) -> Option<u32> {
        self.grid.index(device).map(|index| self.rows[index]).filter(|&row| row != NO_ROW)
    }

    /// Whether there is line of sight between the open cell with this row and the cell with index `uav`.
    pub(crate) fn sees(&self, row: u32, uav: usize) -> bool {
        self.bits[row as usize * self.words_per_row + uav / 64] & (1 << (uav % 64)) != 0
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
}
