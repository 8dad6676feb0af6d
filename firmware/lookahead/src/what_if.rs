//! What-if: the path from here under other preferences, with the data and energy expected of it.

use crate::decide::W_DATA_MAX;
use crate::{Budget, Effort, Expected, LookAhead, Problem, STOPS_MAX, Tour, View};
use gleaner_units::{Action, Cell};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// The weights of data that are shown.
const WEIGHTS: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// A corner and a stop for each stop, two corners on the way home, the start and the terminal.
const WAYPOINTS_MAX: usize = 2 * STOPS_MAX + 6;
/// Temperatures of the search, percent of the data.
const TEMPERATURES: [f32; 2] = [1.0, 0.1];

/// A cell where the path turns or the aircraft hovers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Waypoint {
    /// The cell.
    pub cell: Cell,
    /// Slots of hovering there.
    pub slots: u8,
}

/// The best plan found under one preference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outlook {
    /// Weight of data.
    pub w_data: f32,
    /// What the rest of the mission brings and uses.
    pub expected: Expected,
    /// From the present cell to the terminal; straight lines between waypoints.
    pub path: Vec<Waypoint, WAYPOINTS_MAX>,
}

impl<const D: usize> LookAhead<D> {
    /// The plans for `w_data` = 0, 0.25, 0.5, 0.75 and 1, each searched with `budget`; `None` without a map. Plan, channel
    /// fit and random draws of the decisions stay as they are. To be called after [`LookAhead::propose`] in the same slot.
    ///
    /// # Cost
    /// Five times `budget.tours` mean flights.
    #[must_use]
    pub fn what_if(&self, view: &View<'_>, budget: Budget) -> Option<[Outlook; 5]> {
        if !self.has_map() {
            return None;
        }
        let model = self.model(view.guard);
        let state = self.state(view);
        let mut rng = self.rng();
        let mut tour = Tour::HOME;
        Some(WEIGHTS.map(|w_data| {
            let problem = Problem { model: &model, state: &state, w_data: w_data.min(W_DATA_MAX) };
            let half = Effort { tours: budget.tours / 2, temperatures: TEMPERATURES };
            // From the plan of the weight before, and from the kept plan.
            let onward = problem.anneal(tour.clone(), half, &mut rng);
            let kept = problem.anneal(self.plan().cloned().unwrap_or(Tour::HOME), half, &mut rng);
            tour = if kept.0 > onward.0 { kept.1 } else { onward.1 };
            let mut path = Path::new(view.cell);
            let mut end = state;
            end.finish_with(&model, &tour, &mut |cell, action| path.follow(cell, action));
            let energy = 0.5 * (state.hovers_left - end.hovers_left) as f32;
            Outlook {
                w_data,
                expected: Expected { data_units: end.collected, energy },
                path: path.end(end.cell),
            }
        }))
    }
}

/// Turns a sequence of actions into waypoints.
struct Path {
    waypoints: Vec<Waypoint, WAYPOINTS_MAX>,
    heading: Option<Action>,
}

impl Path {
    fn new(cell: Cell) -> Path {
        let mut waypoints = Vec::new();
        let _ = waypoints.push(Waypoint { cell, slots: 0 });
        Path { waypoints, heading: None }
    }

    fn follow(&mut self, cell: Cell, action: Action) {
        if self.heading != Some(action) && self.waypoints.last().is_some_and(|last| last.cell != cell) {
            let _ = self.waypoints.push(Waypoint { cell, slots: 0 });
        }
        if action == Action::Hover
            && let Some(last) = self.waypoints.last_mut()
        {
            last.slots = last.slots.saturating_add(1);
        }
        self.heading = Some(action);
    }

    fn end(mut self, cell: Cell) -> Vec<Waypoint, WAYPOINTS_MAX> {
        if self.waypoints.last().is_some_and(|last| last.cell != cell || self.waypoints.len() == 1) {
            let _ = self.waypoints.push(Waypoint { cell, slots: 0 });
        }
        self.waypoints
    }
}
