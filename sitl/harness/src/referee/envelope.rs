//! The referee's own arithmetic of the safety envelope, from the mission alone. It shares no code with the guard.

use gleaner_pilot::Mission;
use gleaner_units::{Action, BatteryUnits, Cell};
use std::collections::{HashMap, VecDeque};

/// Moves to the terminal for every cell of the fence that reaches it.
#[derive(Clone, Debug)]
pub(super) struct Envelope {
    moves: HashMap<Cell, f32>,
    pub terminal: Cell,
}

impl Envelope {
    pub fn new(mission: &Mission) -> Envelope {
        let terminal = mission.terminal;
        let mut moves = HashMap::from([(terminal, 0.0)]);
        let mut frontier = VecDeque::from([terminal]);
        while let Some(cell) = frontier.pop_front() {
            let next_moves = moves[&cell] + 1.0;
            for (dx, dy) in [(0, 1), (-1, 0), (0, -1), (1, 0)] {
                let next = Cell::new(cell.x + dx, cell.y + dy);
                if mission.fence.contains(next) && !moves.contains_key(&next) {
                    moves.insert(next, next_moves);
                    frontier.push_back(next);
                }
            }
        }
        Envelope { moves, terminal }
    }

    /// Moves to the terminal; `None` outside the fence.
    pub fn moves(&self, cell: Cell) -> Option<f32> {
        self.moves.get(&cell).copied()
    }

    /// Whether `action` at `cell` stays inside the fence and leaves enough of `battery` for the way to the terminal
    /// and the reserve, at the paper's prices. On the terminal the way takes two moves, out and back, because only a
    /// move into the terminal ends a mission.
    pub fn allows(&self, cell: Cell, action: Action, battery: BatteryUnits, reserve: BatteryUnits) -> bool {
        let next = cell.after(action);
        let Some(moves) = self.moves(next) else { return false };
        let needed = if action == Action::Hover && moves == 0.0 { 2.0 } else { moves };
        let cost = if action == Action::Hover { 0.5 } else { 1.0 };
        battery.0 - cost >= needed + reserve.0
    }

    /// Whether the battery covers the way home and the reserve.
    fn is_feasible(&self, cell: Cell, battery: BatteryUnits, reserve: BatteryUnits) -> bool {
        let needed = self.moves(cell).map(|moves| if moves == 0.0 { 2.0 } else { moves });
        needed.is_some_and(|needed| battery.0 >= needed + reserve.0)
    }

    /// Whether a decision may be flown: inside the envelope, or a move that shortens the way home from a state in
    /// which the battery does not cover it, or during a return.
    pub fn permits(
        &self,
        cell: Cell,
        action: Action,
        battery: BatteryUnits,
        reserve: BatteryUnits,
        returns: bool,
    ) -> bool {
        let shortens = match (self.moves(cell), self.moves(cell.after(action))) {
            (Some(here), Some(there)) => there < here,
            _ => false,
        };
        let desperate = !self.is_feasible(cell, battery, reserve);
        let waits = desperate && cell == self.terminal && action == Action::Hover;
        self.allows(cell, action, battery, reserve) || (shortens && (returns || desperate)) || waits
    }
}
