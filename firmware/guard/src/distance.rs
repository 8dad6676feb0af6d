//! Shortest paths to the terminal inside the fence.

use gleaner_units::{Action, Cell, CellSet, Grid, MAX_CELLS};

const UNREACHED: u16 = u16::MAX;

/// Moves to the terminal for every cell of a grid.
#[derive(Clone, Debug)]
pub(crate) struct DistanceField {
    grid: Grid,
    moves: [u16; MAX_CELLS],
}

impl DistanceField {
    /// Breadth-first search from `terminal` over the cells of `fence`.
    pub(crate) fn new(fence: &CellSet, terminal: Cell) -> DistanceField {
        let mut field = DistanceField { grid: fence.grid(), moves: [UNREACHED; MAX_CELLS] };
        // Every cell enters the queue at most once, so it cannot overflow.
        let mut queue = [0_u16; MAX_CELLS];
        let Some(first) = field.grid.index(terminal) else { return field };
        queue[0] = first as u16;
        let (mut head, mut tail) = (0, 1);
        field.set(terminal, 0);
        while head < tail {
            let Some(cell) = queue.get(head).and_then(|&index| field.grid.cell_at(index.into())) else {
                break;
            };
            head += 1;
            let Some(here) = field.at(cell) else { continue };
            for action in Action::MOVES {
                let next = cell.after(action);
                if fence.contains(next)
                    && field.at(next).is_none()
                    && let (Some(slot), Some(index)) = (queue.get_mut(tail), field.grid.index(next))
                {
                    // Below MAX_CELLS, which fits.
                    *slot = index as u16;
                    tail += 1;
                    field.set(next, here.saturating_add(1));
                }
            }
        }
        field
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
