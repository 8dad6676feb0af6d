//! Tours, and the mean flight that evaluates them.

use crate::model::{Model, Transmission};
use gleaner_units::{Action, BatteryUnits, Cell};
use heapless::Vec;

/// The most stops of a tour.
pub const STOPS_MAX: usize = 24;

/// A place to hover, for how long, and the way to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stop {
    /// Where to hover.
    pub cell: Cell,
    /// Slots to hover at most; the dwell ends early when no device with data is received.
    pub slots: u8,
    /// Whether the way leads along the row first and then along the column, or the other way round.
    pub east_first: bool,
}

/// Stops in order, then the terminal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tour {
    /// The stops.
    pub stops: Vec<Stop, STOPS_MAX>,
    /// The way home from the last stop, see [`Stop::east_first`].
    pub east_first: bool,
}

impl Tour {
    /// Straight home.
    pub const HOME: Tour = Tour { stops: Vec::new(), east_first: false };

    /// Puts a stop before the stop with index `at`; a full tour stays as it is.
    pub(crate) fn insert(&mut self, at: usize, stop: Stop) {
        if self.stops.is_full() {
            return;
        }
        let mut carried = stop;
        for place in self.stops.iter_mut().skip(at) {
            core::mem::swap(place, &mut carried);
        }
        let _ = self.stops.push(carried);
    }

    /// Takes out the stop with index `at`, or the last one.
    pub(crate) fn remove(&mut self, at: usize) -> Option<Stop> {
        let mut carried = self.stops.pop()?;
        for place in self.stops.iter_mut().skip(at).rev() {
            core::mem::swap(place, &mut carried);
        }
        Some(carried)
    }

    /// Exchanges two stops.
    pub(crate) fn swap(&mut self, a: usize, b: usize) {
        if let (Some(&first), Some(&second)) = (self.stops.get(a), self.stops.get(b)) {
            for (at, stop) in [(a, second), (b, first)] {
                if let Some(place) = self.stops.get_mut(at) {
                    *place = stop;
                }
            }
        }
    }
}

/// A mission under way in the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<const D: usize> {
    /// Where the aircraft is.
    pub cell: Cell,
    /// Battery left, in hovers (half battery units): whole numbers, so that sums have no rounding errors.
    pub hovers_left: i32,
    /// What each device holds, data units.
    pub remaining: [f32; D],
    /// Data units collected since the mean flight began.
    pub collected: f32,
    /// Whether a move has ended the mission.
    pub over: bool,
    /// The first action of the mean flight.
    pub first: Option<Action>,
    /// What the present slot carries, where live SNR says so: it overrides the model in the first slot.
    pub present: Option<Transmission>,
}

/// What an action takes from the battery, in hovers.
const fn hovers(action: Action) -> i32 {
    if matches!(action, Action::Hover) { 1 } else { 2 }
}

impl<const D: usize> State<D> {
    /// A mission at `cell`, with the data that each device holds; devices beyond `D` are left out.
    #[must_use]
    pub fn new(cell: Cell, battery: BatteryUnits, data: impl IntoIterator<Item = f32>) -> State<D> {
        let mut remaining = [0.0; D];
        for (remaining, units) in remaining.iter_mut().zip(data) {
            *remaining = units;
        }
        let hovers_left = libm::floorf(2.0 * battery.0) as i32;
        State { cell, hovers_left, remaining, collected: 0.0, over: false, first: None, present: None }
    }

    /// Battery units left.
    #[must_use]
    pub fn battery(&self) -> BatteryUnits {
        BatteryUnits(0.5 * self.hovers_left as f32)
    }

    /// Flies one slot: the device that the model names sends, then the aircraft hovers or moves.
    pub fn slot(&mut self, model: &impl Model, action: Action) {
        self.first = self.first.or(Some(action));
        let transmission = self.present.take().or_else(|| model.transmission(self.cell, &self.remaining));
        if let Some(Transmission { device, units }) = transmission
            && let Some(remaining) = self.remaining.get_mut(device)
        {
            let sent = units.min(*remaining);
            *remaining -= sent;
            self.collected += sent;
        }
        self.cell = self.cell.after(action);
        self.hovers_left -= hovers(action);
        self.over = action != Action::Hover && self.cell == model.terminal();
    }

    /// Flies the stops as far as the battery lasts, then home; returns how many stops were begun.
    ///
    /// From a state that the guard calls feasible, no step leaves the envelope. A stop that cannot be reached along its
    /// way inside the fence ends the tour.
    pub fn finish(&mut self, model: &impl Model, tour: &Tour) -> usize {
        self.finish_with(model, tour, &mut |_, _| {})
    }

    /// Like [`State::finish`]; `observe` gets every cell and the action flown from there.
    pub(crate) fn finish_with(
        &mut self,
        model: &impl Model,
        tour: &Tour,
        observe: &mut impl FnMut(Cell, Action),
    ) -> usize {
        let home = model.terminal();
        let reserve = model.reserve_hovers();
        let mut begun = 0;
        for stop in &tour.stops {
            let Some(moves_home) = model.moves_home(stop.cell) else { break };
            let moves = self.cell.manhattan(stop.cell) as i32 + i32::from(moves_home).max(1);
            if self.over || self.hovers_left < 2 * moves + reserve {
                break;
            }
            begun += 1;
            if !self.walk(model, stop.cell, stop.east_first, observe) {
                break;
            }
            // Hovering on the terminal does not end the mission: that takes a move out and a move back.
            let needed = if self.cell == home { 4 } else { 2 * i32::from(moves_home) };
            for _ in 0..i32::from(stop.slots).min(self.hovers_left - needed - reserve) {
                if self.over || model.transmission(self.cell, &self.remaining).is_none() {
                    break;
                }
                observe(self.cell, Action::Hover);
                self.slot(model, Action::Hover);
            }
        }
        self.fly_home(model, tour.east_first, observe);
        begun
    }

    fn fly_home(&mut self, model: &impl Model, east_first: bool, observe: &mut impl FnMut(Cell, Action)) {
        let home = model.terminal();
        if !self.over && self.cell == home {
            let mut moves = Action::MOVES.into_iter();
            let Some(out) = moves.find(|&out| model.moves_home(self.cell.after(out)).is_some()) else {
                return;
            };
            observe(self.cell, out);
            self.slot(model, out);
        }
        while !self.over {
            let Some(here) = model.moves_home(self.cell) else { return };
            let shortens =
                |action: &Action| model.moves_home(self.cell.after(*action)).is_some_and(|m| m < here);
            let along = towards(self.cell, home, east_first).filter(shortens);
            let Some(action) = along.or_else(|| Action::MOVES.into_iter().find(shortens)) else { return };
            observe(self.cell, action);
            self.slot(model, action);
        }
    }

    /// Flies along one axis, then along the other. Returns false where the fence or the battery ends the way, true on
    /// arrival or when a move into the terminal has ended the mission.
    fn walk(
        &mut self,
        model: &impl Model,
        to: Cell,
        east_first: bool,
        observe: &mut impl FnMut(Cell, Action),
    ) -> bool {
        while let Some(action) = towards(self.cell, to, east_first) {
            if self.over {
                break;
            }
            let moves_home = model.moves_home(self.cell.after(action));
            let is_affordable =
                |moves: u16| self.hovers_left - 2 >= 2 * i32::from(moves) + model.reserve_hovers();
            if !moves_home.is_some_and(is_affordable) {
                return false;
            }
            observe(self.cell, action);
            self.slot(model, action);
        }
        true
    }
}

/// The next move of an L-shaped way; `None` at its end.
fn towards(from: Cell, to: Cell, east_first: bool) -> Option<Action> {
    let east = match to.x.cmp(&from.x) {
        core::cmp::Ordering::Greater => Some(Action::East),
        core::cmp::Ordering::Less => Some(Action::West),
        core::cmp::Ordering::Equal => None,
    };
    let north = match to.y.cmp(&from.y) {
        core::cmp::Ordering::Greater => Some(Action::North),
        core::cmp::Ordering::Less => Some(Action::South),
        core::cmp::Ordering::Equal => None,
    };
    if east_first { east.or(north) } else { north.or(east) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tour(cells: &[i16]) -> Tour {
        let stop = |&x: &i16| Stop { cell: Cell::new(x, 0), slots: 0, east_first: true };
        Tour { stops: cells.iter().map(stop).collect(), east_first: true }
    }

    fn columns(tour: &Tour) -> std::vec::Vec<i16> {
        tour.stops.iter().map(|stop| stop.cell.x).collect()
    }

    #[test]
    fn stops_are_inserted_removed_and_swapped_in_order() {
        let mut stops = tour(&[1, 2, 3]);
        stops.insert(1, Stop { cell: Cell::new(9, 0), slots: 0, east_first: true });
        assert_eq!(columns(&stops), [1, 9, 2, 3]);
        assert_eq!(stops.remove(2).map(|stop| stop.cell.x), Some(2));
        assert_eq!(columns(&stops), [1, 9, 3]);
        assert_eq!(stops.remove(0).map(|stop| stop.cell.x), Some(1));
        stops.swap(0, 1);
        assert_eq!(columns(&stops), [3, 9]);
        stops.swap(0, 7);
        assert_eq!(stops.remove(1).map(|stop| stop.cell.x), Some(9));
        assert_eq!(columns(&stops), [3]);
        assert_eq!(Tour::HOME.clone().remove(0), None);
        let mut full = tour(&[0; STOPS_MAX]);
        full.insert(0, Stop { cell: Cell::new(9, 0), slots: 0, east_first: true });
        assert_eq!(columns(&full), [0; STOPS_MAX]);
    }
}
