//! The city grid: cells, neighbours, indices.

use crate::{Action, Metres};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Most cells of a grid on a board without an operating system.
pub const BOARD_CELLS: usize = 2048;

/// Most cells of a grid: the capacity of every table of cells. A computer has the memory for 128 x 128.
pub const MAX_CELLS: usize = if cfg!(target_os = "none") { BOARD_CELLS } else { 128 * 128 };

/// One cell: x counts east, y counts north, `(0, 0)` is the south-west corner of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Cell {
    /// Column, counted east.
    pub x: i16,
    /// Row, counted north.
    pub y: i16,
}

impl Cell {
    /// The cell in column `x`, row `y`.
    #[must_use]
    pub const fn new(x: i16, y: i16) -> Cell {
        Cell { x, y }
    }

    /// The cell after `action`, which may be outside the grid.
    #[must_use]
    pub const fn after(self, action: Action) -> Cell {
        let (east, north) = action.offset();
        Cell { x: self.x.saturating_add(east), y: self.y.saturating_add(north) }
    }

    /// Moves between two cells without a fence: |dx| + |dy|.
    #[must_use]
    pub const fn manhattan(self, other: Cell) -> u32 {
        self.x.abs_diff(other.x) as u32 + self.y.abs_diff(other.y) as u32
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {})", self.x, self.y)
    }
}

/// A rectangle of square cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    width: u16,
    height: u16,
    cell_m: f32,
}

/// Why a grid is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridError {
    /// A side of zero cells.
    Empty,
    /// More than [`MAX_CELLS`] cells.
    TooManyCells,
    /// The cell size is not a positive, finite length.
    CellSize,
}

impl fmt::Display for GridError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            GridError::Empty => write!(f, "the grid has no cell"),
            GridError::TooManyCells => write!(f, "the grid has more than {MAX_CELLS} cells"),
            GridError::CellSize => write!(f, "the cell size is not a positive length"),
        }
    }
}

impl core::error::Error for GridError {}

impl Grid {
    /// One cell of 20 m: a placeholder until a mission is loaded.
    pub const ONE_CELL: Grid = Grid { width: 1, height: 1, cell_m: 20.0 };

    /// `width` x `height` cells of `cell` metres a side.
    ///
    /// # Errors
    /// See [`GridError`].
    pub fn new(width: u16, height: u16, cell: Metres) -> Result<Grid, GridError> {
        let count = usize::from(width) * usize::from(height);
        if count == 0 {
            Err(GridError::Empty)
        } else if count > MAX_CELLS {
            Err(GridError::TooManyCells)
        } else if !(cell.0.is_finite() && cell.0 > 0.0) {
            Err(GridError::CellSize)
        } else {
            Ok(Grid { width, height, cell_m: cell.0 })
        }
    }

    /// Cells from west to east.
    #[must_use]
    pub const fn width(&self) -> u16 {
        self.width
    }

    /// Cells from south to north.
    #[must_use]
    pub const fn height(&self) -> u16 {
        self.height
    }

    /// The side of a cell.
    #[must_use]
    pub const fn cell(&self) -> Metres {
        Metres(self.cell_m)
    }

    /// Number of cells, at most [`MAX_CELLS`].
    #[must_use]
    pub const fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Always `false`: a grid has at least one cell.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        false
    }

    /// Whether the cell is inside.
    #[must_use]
    pub const fn contains(&self, cell: Cell) -> bool {
        cell.x >= 0 && cell.y >= 0 && (cell.x as u16) < self.width && (cell.y as u16) < self.height
    }

    /// Row-major index from the south-west corner, below [`Grid::len`]; `None` outside.
    #[must_use]
    pub const fn index(&self, cell: Cell) -> Option<usize> {
        if self.contains(cell) { Some(cell.y as usize * self.width as usize + cell.x as usize) } else { None }
    }

    /// The cell with this index; `None` at or above [`Grid::len`].
    #[must_use]
    pub const fn cell_at(&self, index: usize) -> Option<Cell> {
        let width = self.width as usize;
        // The width is never zero. The checked operations leave no panic path in the board's image.
        match (index.checked_rem(width), index.checked_div(width)) {
            (Some(x), Some(y)) if index < self.len() => Some(Cell { x: x as i16, y: y as i16 }),
            _ => None,
        }
    }

    /// The cell after `action`; `None` outside the grid.
    #[must_use]
    pub const fn step(&self, cell: Cell, action: Action) -> Option<Cell> {
        let next = cell.after(action);
        if self.contains(next) { Some(next) } else { None }
    }

    /// All cells, in index order.
    pub fn cells(&self) -> impl Iterator<Item = Cell> + use<> {
        let grid = *self;
        (0..grid.len()).filter_map(move |index| grid.cell_at(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_and_steps_stay_inside_the_grid() {
        let grid = Grid::new(40, 30, Metres(20.0)).unwrap();
        for (index, cell) in grid.cells().enumerate() {
            assert_eq!(grid.index(cell), Some(index));
            for action in Action::ALL {
                assert_eq!(grid.step(cell, action).is_some(), grid.contains(cell.after(action)));
            }
        }
        assert_eq!(grid.index(Cell::new(-1, 0)), None);
        assert_eq!(grid.index(Cell::new(40, 0)), None);
        assert_eq!(grid.cell_at(1200), None);
        assert_eq!(Cell::new(10, 6).manhattan(Cell::new(30, 18)), 32);
    }

    #[test]
    fn invalid_grids_are_refused() {
        assert_eq!(Grid::new(0, 3, Metres(20.0)), Err(GridError::Empty));
        assert_eq!(Grid::new(129, 128, Metres(20.0)), Err(GridError::TooManyCells));
        assert!(Grid::new(128, 128, Metres(20.0)).is_ok());
        assert_eq!(Grid::new(3, 3, Metres(f32::NAN)), Err(GridError::CellSize));
        assert_eq!(Grid::new(3, 3, Metres(0.0)), Err(GridError::CellSize));
    }
}
