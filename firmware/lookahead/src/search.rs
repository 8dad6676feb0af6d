//! Simulated annealing over tours (Kirkpatrick, Gelatt and Vecchi 1983).

use crate::draw::Draw;
use crate::model::{EMPTY_UNITS, Model};
use crate::tour::{STOPS_MAX, State, Stop, Tour};
use gleaner_units::Cell;
use rand_core::Rng;

/// The longest dwell at one stop, slots.
const DWELL_MAX: u8 = 40;
/// The longest dwell of a new stop where much is received, and of one at a device, slots.
const NEW_DWELL_MAX: [usize; 2] = [30, 12];
/// Shifts of a stop, cells along each axis: usual, less frequent, rare.
const SHIFTS: [i16; 3] = [1, 3, 6];
/// Steps by which a dwell is changed, slots.
const DWELL_STEPS: [u8; 4] = [1, 1, 2, 4];

/// The effort of a search, in tours. A tour is one mean flight: at most as many slots as the battery holds hovers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Tours that are evaluated.
    pub tours: u32,
    /// Temperatures at the start and at the end: the loss of utility that is accepted with probability 1/e.
    pub temperatures: [f32; 2],
}

/// A search: the model, the present state and the weight of data.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a, M, const D: usize> {
    /// The model of the mission.
    pub model: &'a M,
    /// The present state.
    pub state: &'a State<D>,
    /// Weight of the data in percent; the battery units get `1 - w_data`.
    pub w_data: f32,
}

impl<M: Model, const D: usize> Problem<'_, M, D> {
    /// The utility of a mean flight from the present state to `end`, `w . (percent, -battery units)`.
    #[must_use]
    pub fn utility(&self, end: &State<D>) -> f32 {
        let percent = 100.0 * (end.collected - self.state.collected) / self.model.initial_units().max(1.0);
        let energy = 0.5 * (self.state.hovers_left - end.hovers_left) as f32;
        self.w_data * percent - (1.0 - self.w_data) * energy
    }

    /// The utility of a tour. Stops beyond the battery are removed, because changing them would change nothing.
    pub fn evaluate(&self, tour: &mut Tour) -> f32 {
        let mut end = *self.state;
        let begun = end.finish(self.model, tour);
        tour.stops.truncate(begun);
        self.utility(&end)
    }

    /// The best tour found by a random walk from `tour`, and its utility. It is never worse than `tour`.
    pub fn anneal(&self, mut tour: Tour, effort: Effort, rng: &mut impl Rng) -> (f32, Tour) {
        let mut value = self.evaluate(&mut tour);
        let mut best = (value, tour.clone());
        let (mut at, mut candidate) = (tour.clone(), tour);
        let [hot, cold] = effort.temperatures;
        let cooling = libm::powf(cold / hot, 1.0 / effort.tours.max(1) as f32);
        let mut temperature = hot;
        for _ in 0..effort.tours {
            temperature *= cooling;
            candidate.clone_from(&at);
            self.change(&mut candidate, rng);
            let changed = self.evaluate(&mut candidate);
            let loss = value - changed;
            if loss <= 0.0 || rng.unit() < libm::expf(-loss / temperature) {
                value = changed;
                core::mem::swap(&mut at, &mut candidate);
                if value > best.0 {
                    best.0 = value;
                    best.1.clone_from(&at);
                }
            }
        }
        best
    }

    /// One random change. The probabilities are shares of 24.
    fn change(&self, tour: &mut Tour, rng: &mut impl Rng) {
        let count = tour.stops.len();
        if count == 0 {
            if rng.below(4) == 0 {
                tour.east_first ^= true;
            } else {
                self.insert(tour, rng);
            }
            return;
        }
        let (index, other) = (rng.below(count), rng.below(count));
        match rng.below(24) {
            0..=8 => self.adjust(tour, index, rng),
            9 => match tour.stops.get_mut(index).filter(|_| rng.below(count + 1) > 0) {
                Some(stop) => stop.east_first ^= true,
                None => tour.east_first ^= true,
            },
            10 => move_dwell(tour, [index, other], rng),
            11..=13 => self.insert(tour, rng),
            14..=15 => {
                tour.remove(index);
            }
            16..=17 => {
                if let Some(stop) = tour.remove(index) {
                    tour.insert(other, stop);
                }
            }
            18 => tour.swap(index, other),
            19..=22 => self.relocate(tour, [index, other], rng),
            _ => {
                if let Some(part) = tour.stops.get_mut(index.min(other)..=index.max(other)) {
                    part.reverse();
                }
            }
        }
    }

    /// Shifts a stop by a few cells, or changes its dwell.
    fn adjust(&self, tour: &mut Tour, index: usize, rng: &mut impl Rng) {
        let Some(stop) = tour.stops.get_mut(index) else { return };
        if rng.below(9) < 5 {
            self.nudge(stop, rng);
            return;
        }
        let by = DWELL_STEPS.get(rng.below(DWELL_STEPS.len())).copied().unwrap_or(1);
        let slots = if rng.coin() { stop.slots.saturating_add(by) } else { stop.slots.saturating_sub(by) };
        stop.slots = slots.min(DWELL_MAX);
    }

    /// Puts a stop somewhere else: where much is received, a few cells away, or halfway to another stop.
    fn relocate(&self, tour: &mut Tour, [index, other]: [usize; 2], rng: &mut impl Rng) {
        let Some(other) = tour.stops.get(other).map(|stop| stop.cell) else { return };
        let Some(stop) = tour.stops.get_mut(index) else { return };
        match rng.below(4) {
            0..=1 => stop.cell = self.model.draw_stop(&self.state.remaining, rng),
            2 => {
                let [.., far] = SHIFTS;
                self.shift(stop, far, rng);
            }
            _ => {
                let middle = |a: i16, b: i16| a.midpoint(b);
                let cell = Cell::new(middle(stop.cell.x, other.x), middle(stop.cell.y, other.y));
                if self.model.moves_home(cell).is_some() {
                    stop.cell = cell;
                }
            }
        }
    }

    fn nudge(&self, stop: &mut Stop, rng: &mut impl Rng) {
        let [near, further, _] = SHIFTS;
        let by = if rng.below(4) == 0 { further } else { near };
        self.shift(stop, by, rng);
    }

    fn shift(&self, stop: &mut Stop, by: i16, rng: &mut impl Rng) {
        let (east, north) = (rng.offset(by), rng.offset(by));
        let to = Cell::new(stop.cell.x.saturating_add(east), stop.cell.y.saturating_add(north));
        if self.model.moves_home(to).is_some() {
            stop.cell = to;
        }
    }

    /// Inserts a stop where much is received, or at a device that has data.
    fn insert(&self, tour: &mut Tour, rng: &mut impl Rng) {
        let devices = self.model.devices();
        if tour.stops.len() >= STOPS_MAX || devices.is_empty() {
            return;
        }
        let east_first = rng.coin();
        let [busy_max, device_max] = NEW_DWELL_MAX;
        let stop = if rng.coin() {
            let cell = self.model.draw_stop(&self.state.remaining, rng);
            Stop { cell, slots: rng.below(busy_max + 1) as u8, east_first }
        } else {
            let device = rng.below(devices.len());
            let has_data = self.state.remaining.get(device).is_some_and(|&left| left > EMPTY_UNITS);
            let Some(&cell) = devices.get(device).filter(|_| has_data) else { return };
            let mut stop = Stop { cell, slots: rng.below(device_max + 1) as u8, east_first };
            if rng.coin() {
                self.nudge(&mut stop, rng);
            }
            stop
        };
        if self.model.moves_home(stop.cell).is_some() {
            tour.insert(rng.below(tour.stops.len() + 1), stop);
        }
    }
}

/// Moves up to three slots of dwell from one stop to another.
fn move_dwell(tour: &mut Tour, [from, to]: [usize; 2], rng: &mut impl Rng) {
    let wanted = 1 + rng.below(3) as u8;
    let Some(from) = tour.stops.get_mut(from) else { return };
    let by = wanted.min(from.slots);
    from.slots -= by;
    if let Some(to) = tour.stops.get_mut(to) {
        to.slots = to.slots.saturating_add(by).min(DWELL_MAX);
    }
}
