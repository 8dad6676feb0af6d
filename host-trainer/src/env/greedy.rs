//! GREEDY, the paper's heuristic: fly to the nearest device, hover until it is empty, continue with the next, return in
//! time.

use crate::env::flight::Flight;
use gleaner_units::{Action, Cell};

/// The heuristic, parameterised by the number of devices that it visits before it returns. All devices collect the most
/// data, none takes the least energy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Greedy {
    visits: usize,
    emptied: usize,
    target: Option<usize>,
}

impl Greedy {
    /// Visits up to `visits` devices, nearest first.
    #[must_use]
    pub const fn new(visits: usize) -> Greedy {
        Greedy { visits, emptied: 0, target: None }
    }

    /// The next action: move to the target and hover above it until it is empty; move to the terminal when the visits
    /// are done or the guard forbids the next move. Moves along the longer axis first.
    pub fn decide(&mut self, flight: &Flight) -> Action {
        let here = flight.episode().uav();
        let mask = flight.mask();
        let towards = match self.choose_target(flight) {
            Some(device) => flight.episode().devices()[device].cell,
            None => flight.episode().terminal(),
        };
        // A mission that starts on its terminal ends with a move into it, so it has to leave first.
        let home = || flight.guard().homeward(here).or_else(|| mask.iter().find(|&a| a != Action::Hover));
        let wish =
            if self.target.is_none() { home() } else { approach(here, towards).or(Some(Action::Hover)) };
        wish.filter(|&action| mask.allows(action))
            .or_else(|| home().filter(|&action| mask.allows(action)))
            .or_else(|| mask.iter().next())
            .expect("a feasible state has an allowed action")
    }

    fn choose_target(&mut self, flight: &Flight) -> Option<usize> {
        let devices = flight.episode().devices();
        let remaining_units = |device: usize| flight.report(device).1;
        if let Some(target) = self.target
            && remaining_units(target) <= 0.0
        {
            self.target = None;
            self.emptied += 1;
        }
        if self.target.is_none() && self.emptied < self.visits {
            let here = flight.episode().uav();
            self.target = devices
                .iter()
                .enumerate()
                .filter(|(index, _)| remaining_units(*index) > 0.0)
                .min_by_key(|(_, device)| here.manhattan(device.cell))
                .map(|(index, _)| index);
        }
        self.target
    }
}

/// The move along the longer axis; `None` at the destination.
pub(crate) fn approach(from: Cell, to: Cell) -> Option<Action> {
    let (east, north) = (to.x - from.x, to.y - from.y);
    if east == 0 && north == 0 {
        None
    } else if east.abs() >= north.abs() {
        Some(if east > 0 { Action::East } else { Action::West })
    } else {
        Some(if north > 0 { Action::North } else { Action::South })
    }
}
