//! Sets of cells, one bit each. The fence is one.

use crate::{Cell, Grid, MAX_CELLS};

const WORDS: usize = MAX_CELLS / 32;

/// A set of cells of one grid, one bit each.
#[derive(Clone, Debug, PartialEq)]
pub struct CellSet {
    grid: Grid,
    words: [u32; WORDS],
}

impl CellSet {
    /// The empty set in `grid`.
    #[must_use]
    pub const fn empty(grid: Grid) -> CellSet {
        CellSet { grid, words: [0; WORDS] }
    }

    /// All cells of `grid`.
    #[must_use]
    pub fn full(grid: Grid) -> CellSet {
        let mut set = CellSet::empty(grid);
        for cell in grid.cells() {
            set.insert(cell);
        }
        set
    }

    /// The grid of the cells.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// Adds a cell; no effect for a cell outside the grid.
    pub fn insert(&mut self, cell: Cell) {
        if let Some((word, bit)) = self.place(cell)
            && let Some(word) = self.words.get_mut(word)
        {
            *word |= bit;
        }
    }

    /// Removes a cell.
    pub fn remove(&mut self, cell: Cell) {
        if let Some((word, bit)) = self.place(cell)
            && let Some(word) = self.words.get_mut(word)
        {
            *word &= !bit;
        }
    }

    /// Whether the cell is in the set; `false` for a cell outside the grid.
    #[must_use]
    pub fn contains(&self, cell: Cell) -> bool {
        self.place(cell).is_some_and(|(word, bit)| self.words.get(word).is_some_and(|w| w & bit != 0))
    }

    /// Number of cells in the set.
    #[must_use]
    pub fn len(&self) -> usize {
        self.used().map(|word| word.count_ones() as usize).sum()
    }

    /// Whether the set is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.used().all(|&word| word == 0)
    }

    /// The cells in the set, in index order.
    pub fn iter(&self) -> impl Iterator<Item = Cell> + use<'_> {
        let words = self.used().enumerate().filter(|(_, bits)| **bits != 0);
        let indices = words.flat_map(|(at, &bits)| {
            (0..32).filter(move |bit| bits & (1 << bit) != 0).map(move |bit| at * 32 + bit)
        });
        indices.filter_map(|index| self.grid.cell_at(index))
    }

    /// The words that this grid has cells for.
    fn used(&self) -> impl Iterator<Item = &u32> {
        self.words.iter().take(self.grid.len().div_ceil(32))
    }

    fn place(&self, cell: Cell) -> Option<(usize, u32)> {
        self.grid.index(cell).map(|index| (index / 32, 1 << (index % 32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Metres;

    #[test]
    fn sets_hold_cells_of_their_grid_only() {
        let grid = Grid::new(7, 5, Metres(20.0)).unwrap();
        let mut set = CellSet::full(grid);
        assert_eq!(set.len(), 35);
        set.remove(Cell::new(6, 4));
        set.insert(Cell::new(7, 4));
        assert_eq!(set.len(), 34);
        assert!(
            !set.contains(Cell::new(6, 4)) && !set.contains(Cell::new(7, 4)) && set.contains(Cell::new(0, 0))
        );
        let last: std::vec::Vec<Cell> = set.iter().skip(32).collect();
        assert_eq!(last, [Cell::new(4, 4), Cell::new(5, 4)]);
        assert!(CellSet::empty(grid).is_empty() && CellSet::empty(grid).iter().next().is_none());
    }
}
