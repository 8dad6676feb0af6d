//! GREEDY, the paper's heuristic: the nearest device, hover until it is empty, the next, home in time.

use crate::env::flight::Flight;
use gleaner_units::{Action, Cell};

/// How many devices to visit before going home: the parameterisation of the heuristic. All of them is its best
/// for data, none its best for energy.
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

    /// The next action: towards the target, hover above it until it is empty, and towards the terminal when the
    /// visits are done or the guard forbids going on. Moves along the axis with more cells to go first.
    pub fn decide(&mut self, flight: &Flight) -> Action {
        let here = flight.episode().uav();
        let mask = flight.mask();
        let towards = match self.choose_target(flight) {
            Some(device) => flight.episode().devices()[device].cell,
            None => flight.episode().terminal(),
        };
        // On the terminal before a mission that starts there: any way out, then back.
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
        if let Some(target) = self.target
            && devices[target].remaining_units <= 0.0
        {
            self.target = None;
            self.emptied += 1;
        }
        if self.target.is_none() && self.emptied < self.visits {
            let here = flight.episode().uav();
            self.target = devices
                .iter()
                .enumerate()
                .filter(|(_, device)| device.remaining_units > 0.0)
                .min_by_key(|(_, device)| here.manhattan(device.cell))
                .map(|(index, _)| index);
        }
        self.target
    }
}

/// The move along the axis with more cells to go; `None` when there.
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
