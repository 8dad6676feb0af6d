//! A planner with full knowledge of map, channel and devices: the oracle that policies are measured against.
//!
//! A plan is a [`Tour`]: places to hover, for how long, and the way between them. Tours are judged by flying them in
//! the mean: each slot brings what the channel's expected rate says, from whichever device is heard best in the mean.
//! The best tour is searched by simulated annealing. How much better the best of all can be, [`upper_bound_percent`] says.

mod bound;
mod known;
pub mod oracle;
mod search;
pub mod teacher;
mod tour;

pub use bound::upper_bound_percent;
pub use known::{Audible, Known, Rates};
pub use search::{Effort, Problem};
pub use tour::{DEVICES_MAX, State, Stop, Tour};

use crate::env::flight::Flight;
use gleaner_units::{Action, Cell};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The largest weight of data that is planned with. With data alone every tour that brings the same would do, and
/// the search would have nothing to tell the shorter one by.
pub const THRIFT: f32 = 0.98;
/// The search from scratch, when a mission begins.
const BEGIN: Effort = Effort { tours: 6_000, temperatures: [1.0, 0.1] };
/// Below this weight of data hardly a detour pays, and little search finds the shortest way.
const DETOURS: f32 = 0.15;
/// The search at every slot, from the tour of the slot before.
const REFINE: Effort = Effort { tours: 250, temperatures: [0.5, 0.05] };

/// The search that is to tell a loss from a tour that was not found.
const DOUBT: Effort = Effort { tours: 1_000, temperatures: [1.0, 0.05] };

/// What is still to be had in a mission under way, slot by slot.
#[derive(Clone, Debug)]
pub struct Prospect {
    known: Known,
    rng: ChaCha8Rng,
    tour: Option<Tour>,
    cell: Option<Cell>,
}

impl Prospect {
    /// Of a mission that begins; all chance of the search comes from `seed`.
    #[must_use]
    pub fn new(known: Known, seed: u64) -> Prospect {
        Prospect { known, rng: ChaCha8Rng::seed_from_u64(seed), tour: None, cell: None }
    }

    /// The utility that the best tour brings which is found from where the flight is, `w . (percent, -battery units)`
    /// with w_data at most [`THRIFT`]; 0 when the flight is over. To be asked once a slot, since the search goes on
    /// from the tour of the slot before.
    #[must_use]
    pub fn value(&mut self, flight: &Flight) -> f32 {
        if flight.is_over() {
            return 0.0;
        }
        let state = State::of(flight);
        let w_data = flight.preference().w_data().min(THRIFT);
        let problem = Problem { known: &self.known, state: &state, w_data };
        let (value, tour) = match self.tour.take() {
            None => {
                let effort = if w_data < DETOURS { REFINE } else { BEGIN };
                problem.anneal(Tour::default(), effort, &mut self.rng)
            }
            Some(mut tour) => {
                // A slot of the dwell is over.
                if self.cell == Some(state.cell)
                    && let Some(stop) = tour.stops.first_mut().filter(|stop| stop.cell == state.cell)
                {
                    stop.slots = stop.slots.saturating_sub(1);
                }
                problem.anneal(tour, REFINE, &mut self.rng)
            }
        };
        self.tour = Some(tour);
        self.cell = Some(state.cell);
        value
    }

    /// What the tour begins with that [`Prospect::value`] found last, from where the flight is.
    #[must_use]
    pub fn advice(&self, flight: &Flight) -> Option<Action> {
        let mut state = State::of(flight);
        state.finish(&self.known, self.tour.as_ref()?);
        state.first
    }

    /// The utility that is found when this action is flown now, what the slot itself brings included.
    pub fn value_with(&self, flight: &Flight, action: Action, rng: &mut impl Rng) -> f32 {
        let before = State::of(flight);
        let mut state = before;
        state.slot(&self.known, action);
        let w_data = flight.preference().w_data().min(THRIFT);
        let so_far = Problem { known: &self.known, state: &before, w_data }.utility(&state);
        let problem = Problem { known: &self.known, state: &state, w_data };
        let tour = self.tour.clone().unwrap_or_default();
        let after = if state.over { 0.0 } else { problem.anneal(tour, DOUBT, rng).0 };
        so_far + after
    }
}
