//! A plan, and what comes of it in the mean.

use super::known::Known;
use crate::env::flight::Flight;
use gleaner_units::{Action, BatteryUnits, Cell};
use gleaner_world::Realization;

/// What counts as empty, data units: less than a thousandth of a device.
const EMPTY_UNITS: f32 = 1.0;
/// Devices of a mission at most.
pub const DEVICES_MAX: usize = 12;

/// A place to hover, for how long at most, and how to go there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stop {
    /// The place.
    pub cell: Cell,
    /// Slots to hover; less when nobody is heard any more.
    pub slots: u8,
    /// East or west first, then north or south; or the other way round.
    pub east_first: bool,
}

/// Stops in order, then the terminal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tour {
    /// The stops.
    pub stops: Vec<Stop>,
    /// How to go home from the last.
    pub east_first: bool,
}

/// A mission under way, without any chance in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Where the aircraft is.
    pub cell: Cell,
    /// What the battery holds, in hovers (half battery units): whole numbers, so that nothing is lost by rounding.
    pub hovers_left: i32,
    /// What each device holds, data units.
    pub remaining: [f32; DEVICES_MAX],
    /// Data units so far.
    pub collected: f32,
    /// Whether a move has ended the mission.
    pub over: bool,
    /// The first action that was flown.
    pub first: Option<Action>,
}

/// What an action takes from the battery, in hovers.
const fn hovers(action: Action) -> i32 {
    if matches!(action, Action::Hover) { 1 } else { 2 }
}

impl State {
    /// Where a mission begins.
    #[must_use]
    pub fn start(realization: &Realization) -> State {
        let data = realization.devices().iter().map(|device| device.data_units);
        State::new(realization.start(), realization.battery(), data)
    }

    /// Where a flight stands.
    #[must_use]
    pub fn of(flight: &Flight) -> State {
        let episode = flight.episode();
        let data = episode.devices().iter().map(|device| device.remaining_units);
        State { over: flight.is_over(), ..State::new(episode.uav(), episode.battery(), data) }
    }

    fn new(cell: Cell, battery: BatteryUnits, data: impl Iterator<Item = f32>) -> State {
        let mut remaining = [0.0; DEVICES_MAX];
        for (remaining, units) in remaining.iter_mut().zip(data) {
            *remaining = units;
        }
        let hovers_left = (2.0 * battery.0).floor() as i32;
        State { cell, hovers_left, remaining, collected: 0.0, over: false, first: None }
    }

    /// Flies one slot: whoever is heard best in the mean sends, then the aircraft hovers or moves.
    pub fn slot(&mut self, known: &Known, action: Action) {
        self.first = self.first.or(Some(action));
        self.collected += self.serve(known);
        self.cell = self.cell.after(action);
        self.hovers_left -= hovers(action);
        self.over = action != Action::Hover && self.cell == known.terminal();
    }

    fn serve(&mut self, known: &Known) -> f32 {
        for link in known.audible(self.cell) {
            let remaining = &mut self.remaining[usize::from(link.device)];
            if *remaining > EMPTY_UNITS {
                let sent = link.units.min(*remaining);
                *remaining -= sent;
                return sent;
            }
        }
        0.0
    }

    fn hears_somebody(&self, known: &Known) -> bool {
        known.audible(self.cell).iter().any(|link| self.remaining[usize::from(link.device)] > EMPTY_UNITS)
    }

    /// Flies the stops as far as the battery lasts, then home. Feasible from a feasible state: a stop is only begun
    /// if the way home from it is affordable. Gives the number of stops that were begun.
    pub fn finish(&mut self, known: &Known, tour: &Tour) -> usize {
        let home = known.terminal();
        let way = |a: Cell, b: Cell| a.manhattan(b) as i32;
        let mut begun = 0;
        for stop in &tour.stops {
            if self.over || self.hovers_left < 2 * (way(self.cell, stop.cell) + way(stop.cell, home).max(1)) {
                break;
            }
            begun += 1;
            self.walk(known, stop.cell, stop.east_first);
            // Hovering on the terminal does not end the mission: out and back.
            let needed = if self.cell == home { 4 } else { 2 * way(self.cell, home) };
            for _ in 0..i32::from(stop.slots).min(self.hovers_left - needed) {
                if self.over || !self.hears_somebody(known) {
                    break;
                }
                self.slot(known, Action::Hover);
            }
        }
        if !self.over && self.cell == home {
            let out = Action::MOVES.into_iter().find(|&out| known.grid().contains(self.cell.after(out)));
            self.slot(known, out.unwrap_or(Action::North));
        }
        self.walk(known, home, tour.east_first);
        begun
    }

    /// Along one axis, then along the other; ends early on the terminal, where a move ends the mission.
    fn walk(&mut self, known: &Known, to: Cell, east_first: bool) {
        for east in [east_first, !east_first] {
            let left = if east { to.x - self.cell.x } else { to.y - self.cell.y };
            let action = match (east, left > 0) {
                (true, true) => Action::East,
                (true, false) => Action::West,
                (false, true) => Action::North,
                (false, false) => Action::South,
            };
            for _ in 0..left.unsigned_abs() {
                if self.over {
                    return;
                }
                self.slot(known, action);
            }
        }
    }
}
