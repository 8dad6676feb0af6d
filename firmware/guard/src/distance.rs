//! Shortest paths to the terminal inside the fence.

use gleaner_units::{Action, Cell, CellSet, Grid, MAX_CELLS};

const UNREACHED: u16 = u16::MAX;

/// Moves to the terminal from every cell of a grid.
#[derive(Clone, Debug)]
pub(crate) struct DistanceField {
    grid: Grid,
    moves: [u16; MAX_CELLS],
}

impl DistanceField {
    /// A field in which no cell reaches the terminal.
    pub(crate) const fn unreached(grid: Grid) -> DistanceField {
        DistanceField { grid, moves: [UNREACHED; MAX_CELLS] }
    }

    /// Breadth-first search from `terminal` over the cells of `fence`, in place. The frontiers are cell sets; a
    /// queue would take as much stack as the field.
    pub(crate) fn search(&mut self, fence: &CellSet, terminal: Cell) {
        self.grid = fence.grid();
        self.moves.fill(UNREACHED);
        let mut frontier = CellSet::empty(self.grid);
        frontier.insert(terminal);
        self.set(terminal, 0);
        // No shortest path has as many moves as the grid has cells.
        for moves in 1..=MAX_CELLS as u16 {
            let mut next_frontier = CellSet::empty(self.grid);
            for cell in frontier.iter() {
                for next in Action::MOVES.map(|action| cell.after(action)) {
                    if fence.contains(next) && self.at(next).is_none() {
                        self.set(next, moves);
                        next_frontier.insert(next);
                    }
                }
            }
            if next_frontier.is_empty() {
                return;
            }
            frontier = next_frontier;
        }
    }

    pub(crate) const fn grid(&self) -> Grid {
        self.grid
    }

    pub(crate) fn at(&self, cell: Cell) -> Option<u16> {
        let moves = *self.moves.get(self.grid.index(cell)?)?;
        (moves != UNREACHED).then_some(moves)
    }

    fn set(&mut self, cell: Cell, moves: u16) {
        if let Some(slot) = self.grid.index(cell).and_then(|index| self.moves.get_mut(index)) {
            *slot = moves;
        }
    }
}
