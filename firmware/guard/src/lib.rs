//! The safety envelope: the actions that the policy may take in a given state.
//!
//! An action is allowed if it stays inside the fence and if the battery afterwards still covers the way to the terminal cell
//! and a reserve:
//!
//! ```text
//! b - cost(a) >= distance(p + a, terminal) + reserve          (paper, "safety controller")
//! ```
//!
//! # Glossary
//! - **fence**: the cells that the aircraft may fly over, a subset of the map.
//! - **distance**: moves on the shortest path to the terminal inside the fence.
//! - **way home**: battery units needed to *end* the mission. This is the distance, except on the terminal cell: a mission
//!   ends when a *move* enters the terminal, so from there it takes two moves, out and back. With the distance instead, a
//!   mission that starts on its terminal could hover until it can afford no move, and never end.
//! - **feasible**: the battery covers way home and reserve.
//!
//! # The theorem
//! From a feasible state at least one action is allowed, and every allowed action leads to a feasible state or ends the
//! mission on the terminal with `b >= reserve`. By induction every policy reaches the terminal. `tests/theorem.rs` checks
//! every state of small grids and random walks on large ones.
//!
//! # When you may trust this
//! The theorem is about cells and a battery level in units. It assumes:
//! - **Unit price.** A move takes at most one unit and a hover at most half of one. The pilot learns the real prices from the
//!   measured charge and offers the guard the charge divided by the higher one. The margin on it is 5 %, and grows from
//!   1.1 times the nominal price on, to 23 % at twice. Until the battery has shown a few percent of use, the nominal price holds,
//!   and in slots of more than 4 s (`GLN_SPEED` below 5 m/s in cells of 20 m) the price of hovering for so long.
//! - **Wind.** The pilot learns from the courses flown what a headwind adds on the way home, and takes it off the charge before it
//!   is offered. A wind that begins later, or that was met on one course only, is not covered until it is learned;
//!   `GLN_RESERVE` is for that.
//! - **Landing.** Descent and landing at the terminal are taken off the charge before it is offered, from the altitude and
//!   the autopilot's descent rate. After a fault the autopilot returns to where it took off, which is not budgeted.
//! - **Place.** The aircraft is in the given cell, or on a decided move into it whose unit is taken off.
//!
//! If the battery drains faster, the state becomes infeasible, and [`Guard::mask`] then allows only moves that shorten the
//! way home. The guard does not depend on the policy.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod distance;

use core::fmt;
use distance::DistanceField;
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, CellSet, Grid};

/// Fence, terminal, reserve and distances. About four kilobytes.
#[derive(Clone, Debug)]
pub struct Guard {
    terminal: Cell,
    reserve: BatteryUnits,
    distances: DistanceField,
}

/// Why an envelope is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuardError {
    /// The terminal cell is outside the fence.
    TerminalOutsideFence,
    /// No neighbour of the terminal is inside the fence, so no move can end the mission.
    TerminalIsolated,
    /// The reserve is negative or not finite.
    Reserve,
}

impl fmt::Display for GuardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            GuardError::TerminalOutsideFence => "the terminal cell is outside the fence",
            GuardError::TerminalIsolated => "no cell next to the terminal is inside the fence",
            GuardError::Reserve => "the reserve is not a finite number >= 0",
        })
    }
}

impl core::error::Error for GuardError {}

impl Guard {
    /// An envelope that allows no action, until [`Guard::enclose`].
    #[must_use]
    pub const fn closed() -> Guard {
        Guard {
            terminal: Cell::new(0, 0),
            reserve: BatteryUnits(0.0),
            distances: DistanceField::unreached(Grid::ONE_CELL),
        }
    }

    /// Computes the distances inside `fence` by breadth-first search from `terminal`.
    ///
    /// # Errors
    /// See [`GuardError`].
    ///
    /// # Cost
    /// One visit for each cell, and 5 KB of stack ([`Guard::enclose`] needs 1 KB).
    pub fn new(fence: &CellSet, terminal: Cell, reserve: BatteryUnits) -> Result<Guard, GuardError> {
        check_reserve(reserve)?;
        let mut guard = Guard::closed();
        guard.enclose(fence, terminal)?;
        guard.reserve = reserve;
        Ok(guard)
    }

    /// Changes fence and terminal in place and keeps the reserve. For boards with little stack.
    ///
    /// # Errors
    /// As [`Guard::check`]; the envelope is then unchanged.
    ///
    /// # Cost
    /// One visit for each cell, and 1 KB of stack.
    pub fn enclose(&mut self, fence: &CellSet, terminal: Cell) -> Result<(), GuardError> {
        Guard::check(fence, terminal)?;
        self.terminal = terminal;
        self.distances.search(fence, terminal);
        Ok(())
    }

    /// Checks that a mission inside `fence` can end at `terminal`.
    ///
    /// # Errors
    /// [`GuardError::TerminalOutsideFence`], [`GuardError::TerminalIsolated`].
    pub fn check(fence: &CellSet, terminal: Cell) -> Result<(), GuardError> {
        if !fence.contains(terminal) {
            return Err(GuardError::TerminalOutsideFence);
        }
        if !Action::MOVES.iter().any(|&action| fence.contains(terminal.after(action))) {
            return Err(GuardError::TerminalIsolated);
        }
        Ok(())
    }

    /// Changes the reserve (`GLN_RESERVE`).
    ///
    /// # Errors
    /// [`GuardError::Reserve`]; the reserve is then unchanged.
    pub fn set_reserve(&mut self, reserve: BatteryUnits) -> Result<(), GuardError> {
        check_reserve(reserve)?;
        self.reserve = reserve;
        Ok(())
    }

    /// The grid of the fence.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.distances.grid()
    }

    /// The cell that ends the mission.
    #[must_use]
    pub const fn terminal(&self) -> Cell {
        self.terminal
    }

    /// The reserve.
    #[must_use]
    pub const fn reserve(&self) -> BatteryUnits {
        self.reserve
    }

    /// Moves to the terminal on the shortest path inside the fence; `None` outside the fence or without a path.
    #[must_use]
    pub fn distance(&self, cell: Cell) -> Option<u16> {
        self.distances.at(cell)
    }

    /// Battery units needed to end the mission: the distance, or 2 on the terminal.
    #[must_use]
    pub fn way_home(&self, cell: Cell) -> Option<BatteryUnits> {
        let distance = self.distance(cell)?;
        Some(BatteryUnits(if distance == 0 { 2.0 } else { f32::from(distance) }))
    }

    /// Battery beyond the distance to the terminal: the paper's b_SC, `b - distance`. Independent of the reserve, so that the
    /// policy's input does not change with it.
    #[must_use]
    pub fn spare(&self, cell: Cell, battery: BatteryUnits) -> Option<BatteryUnits> {
        self.distance(cell).map(|distance| battery - BatteryUnits(f32::from(distance)))
    }

    /// Whether the battery covers way home and reserve; `false` for NaN.
    #[must_use]
    pub fn is_feasible(&self, cell: Cell, battery: BatteryUnits) -> bool {
        self.way_home(cell).is_some_and(|needed| battery.0 >= (needed + self.reserve).0)
    }

    /// The actions allowed at `cell` with `battery` left.
    ///
    /// In an infeasible state these are the moves that shorten the way home, or hover on the terminal. The mask is empty only
    /// where [`Guard::distance`] is `None`.
    #[must_use]
    pub fn mask(&self, cell: Cell, battery: BatteryUnits) -> ActionMask {
        if !self.is_feasible(cell, battery) {
            return self.homeward_moves(cell);
        }
        let mut mask = ActionMask::EMPTY;
        for action in Action::ALL {
            let next = cell.after(action);
            let needed = match action {
                // Hovering on the terminal does not end the mission, moving onto it does.
                Action::Hover => self.way_home(next),
                _ => self.distance(next).map(|distance| BatteryUnits(f32::from(distance))),
            };
            if needed.is_some_and(|needed| (battery - action.cost()).0 >= (needed + self.reserve).0) {
                mask = mask.with(action);
            }
        }
        mask
    }

    /// The first move that shortens the way to the terminal; `None` on the terminal, and without a path to it.
    #[must_use]
    pub fn homeward(&self, cell: Cell) -> Option<Action> {
        self.homeward_moves(cell).iter().find(|&action| action != Action::Hover)
    }

    fn homeward_moves(&self, cell: Cell) -> ActionMask {
        match self.distance(cell) {
            None => ActionMask::EMPTY,
            Some(0) => ActionMask::EMPTY.with(Action::Hover),
            Some(here) => Action::MOVES
                .into_iter()
                .filter(|&action| self.distance(cell.after(action)).is_some_and(|there| there < here))
                .fold(ActionMask::EMPTY, ActionMask::with),
        }
    }
}

fn check_reserve(reserve: BatteryUnits) -> Result<(), GuardError> {
    if reserve.0.is_finite() && reserve.0 >= 0.0 { Ok(()) } else { Err(GuardError::Reserve) }
}
