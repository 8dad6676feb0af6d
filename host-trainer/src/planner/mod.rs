//! A planner that knows map, channel and devices: the oracle that policies are measured against.
//!
//! The search over tours is that of [`gleaner_lookahead`], which flies. The model differs: [`Known`] has the true channel
//! of the world, where the aircraft has the nominal channel and its fit. [`upper_bound_percent`] bounds the optimum from
//! above.

mod bound;
mod known;
pub mod oracle;
pub mod teacher;

pub use bound::upper_bound_percent;
pub use gleaner_lookahead::{Effort, Stop, Tour, W_DATA_MAX};
pub use known::{Audible, Known, Rates};

use crate::env::flight::Flight;
use gleaner_units::{Action, Cell};
use gleaner_world::Realization;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The most devices of a mission that is planned.
pub const DEVICES_MAX: usize = 12;
/// A mission under way in the model.
pub type State = gleaner_lookahead::State<DEVICES_MAX>;
/// A search with the true channel.
pub type Problem<'a> = gleaner_lookahead::Problem<'a, Known, DEVICES_MAX>;

/// The search from scratch at the start of a mission.
const BEGIN: Effort = Effort { tours: 6_000, temperatures: [1.0, 0.1] };
/// Below this weight of data few detours pay, and a search of [`REFINE`] finds the shortest way at the start, too.
const DETOUR_W_DATA: f32 = 0.15;
/// The search in each slot, from the tour of the slot before.
const REFINE: Effort = Effort { tours: 250, temperatures: [0.5, 0.05] };
/// The search after a given action. It is longer than [`REFINE`], so that the difference of two actions is not the noise
/// of two searches.
const COMPARE: Effort = Effort { tours: 1_000, temperatures: [1.0, 0.05] };

/// The state in which a mission begins.
#[must_use]
pub fn initial_state(realization: &Realization) -> State {
    let data = realization.devices().iter().map(|device| device.data_units);
    State::new(realization.start(), realization.battery(), data)
}

/// The present state of a flight.
#[must_use]
pub fn state_of(flight: &Flight) -> State {
    let episode = flight.episode();
    let data = episode.devices().iter().map(|device| device.remaining_units);
    State { over: flight.is_over(), ..State::new(episode.uav(), episode.battery(), data) }
}

/// State values of a mission under way, slot by slot.
#[derive(Clone, Debug)]
pub struct Prospect {
    known: Known,
    rng: ChaCha8Rng,
    tour: Option<Tour>,
    cell: Option<Cell>,
}

impl Prospect {
    /// For a mission that begins; `seed` fixes the random draws of the search.
    #[must_use]
    pub fn new(known: Known, seed: u64) -> Prospect {
        Prospect { known, rng: ChaCha8Rng::seed_from_u64(seed), tour: None, cell: None }
    }

    /// The utility of the best tour found from the present state, `w . (percent, -battery units)` with w_data at most
    /// [`W_DATA_MAX`]; 0 when the flight is over. To be called once a slot: the search starts from the tour of the slot
    /// before.
    #[must_use]
    pub fn value(&mut self, flight: &Flight) -> f32 {
        if flight.is_over() {
            return 0.0;
        }
        let state = state_of(flight);
        let w_data = flight.preference().w_data().min(W_DATA_MAX);
        let problem = Problem { model: &self.known, state: &state, w_data };
        let (value, tour) = match self.tour.take() {
            None => {
                let effort = if w_data < DETOUR_W_DATA { REFINE } else { BEGIN };
                problem.anneal(Tour::default(), effort, &mut self.rng)
            }
            Some(mut tour) => {
                // One slot of the dwell has been flown.
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

    /// The first action of the tour that [`Prospect::value`] found last.
    #[must_use]
    pub fn advice(&self, flight: &Flight) -> Option<Action> {
        let mut state = state_of(flight);
        state.finish(&self.known, self.tour.as_ref()?);
        state.first
    }

    /// The utility of the best tour found after this action, including the data and energy of the present slot.
    pub fn value_with(&self, flight: &Flight, action: Action, rng: &mut impl Rng) -> f32 {
        let before = state_of(flight);
        let mut state = before;
        state.slot(&self.known, action);
        let w_data = flight.preference().w_data().min(W_DATA_MAX);
        let so_far = Problem { model: &self.known, state: &before, w_data }.utility(&state);
        let problem = Problem { model: &self.known, state: &state, w_data };
        let tour = self.tour.clone().unwrap_or_default();
        let after = if state.over { 0.0 } else { problem.anneal(tour, COMPARE, rng).0 };
        so_far + after
    }
}
