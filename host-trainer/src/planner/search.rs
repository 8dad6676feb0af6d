//! Simulated annealing over tours (Kirkpatrick, Gelatt and Vecchi 1983).

use super::known::Known;
use super::tour::{State, Stop, Tour};
use gleaner_units::Cell;
use rand::{Rng, RngExt};

/// The largest dwell at one stop, slots.
const DWELL_MAX: u8 = 40;
/// Stops of a tour at most.
const STOPS_MAX: usize = 24;

/// A stop is sometimes shifted by so many cells.
const FAR: i16 = 6;

/// How hard to search.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Tours that are flown in the mean.
    pub tours: u32,
    /// Loss of utility that is accepted with probability 1/e at the start, and at the end.
    pub temperatures: [f32; 2],
}

/// What a search is for: where the mission stands, and what data is worth.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// The mission.
    pub known: &'a Known,
    /// Where it stands.
    pub state: &'a State,
    /// Weight of data, percent of all; energy, battery units, has the rest.
    pub w_data: f32,
}

impl Problem<'_> {
    /// What is gained from here, `w . (percent, -battery units)`.
    #[must_use]
    pub fn utility(&self, end: &State) -> f32 {
        let percent = 100.0 * (end.collected - self.state.collected) / self.known.initial_units().max(1.0);
        let energy = 0.5 * (self.state.hovers_left - end.hovers_left) as f32;
        self.w_data * percent - (1.0 - self.w_data) * energy
    }

    /// The utility of a tour. Stops for which the battery does not last are struck: changes to them would change
    /// nothing.
    pub fn settle(&self, tour: &mut Tour) -> f32 {
        let mut end = *self.state;
        let begun = end.finish(self.known, tour);
        tour.stops.truncate(begun);
        self.utility(&end)
    }

    /// The best tour that is met on a walk that begins at `tour`, and its utility.
    pub fn anneal(&self, mut tour: Tour, effort: Effort, rng: &mut impl Rng) -> (f32, Tour) {
        let mut value = self.settle(&mut tour);
        let mut best = (value, tour.clone());
        let (mut at, mut candidate) = (tour.clone(), tour);
        let [hot, cold] = effort.temperatures;
        let cooling = libm::powf(cold / hot, 1.0 / effort.tours.max(1) as f32);
        let mut temperature = hot;
        for _ in 0..effort.tours {
            temperature *= cooling;
            candidate.clone_from(&at);
            self.change(&mut candidate, rng);
            let changed = self.settle(&mut candidate);
            let loss = value - changed;
            if loss <= 0.0 || rng.random::<f32>() < libm::expf(-loss / temperature) {
                value = changed;
                std::mem::swap(&mut at, &mut candidate);
                if value > best.0 {
                    best = (value, at.clone());
                }
            }
        }
        best
    }

    /// One random change.
    fn change(&self, tour: &mut Tour, rng: &mut impl Rng) {
        let count = tour.stops.len();
        if count == 0 {
            if rng.random_range(0..4) == 0 {
                tour.east_first ^= true;
            } else {
                self.insert(tour, rng);
            }
            return;
        }
        let index = rng.random_range(0..count);
        let stop = &mut tour.stops[index];
        match rng.random_range(0..24) {
            0..=4 => self.nudge(stop, rng),
            5..=8 => {
                let by = [1, 1, 2, 4][rng.random_range(0..4)];
                let slots =
                    if rng.random() { stop.slots.saturating_add(by) } else { stop.slots.saturating_sub(by) };
                stop.slots = slots.min(DWELL_MAX);
            }
            9 => {
                if rng.random_range(0..=count) == 0 {
                    tour.east_first ^= true;
                } else {
                    stop.east_first ^= true;
                }
            }
            10 => {
                // Both ends of the same trade: dwell moved from one stop to another.
                let other = rng.random_range(0..count);
                let by = rng.random_range(1..=3).min(tour.stops[index].slots);
                tour.stops[index].slots -= by;
                tour.stops[other].slots = (tour.stops[other].slots + by).min(DWELL_MAX);
            }
            11..=13 => self.insert(tour, rng),
            14..=15 => {
                tour.stops.remove(index);
            }
            16..=17 => {
                let stop = tour.stops.remove(index);
                tour.stops.insert(rng.random_range(0..count), stop);
            }
            18 => tour.stops.swap(index, rng.random_range(0..count)),
            19..=20 => stop.cell = self.known.busy_cell(rng),
            21 => self.shift(stop, FAR, rng),
            22 => {
                let other = tour.stops[rng.random_range(0..count)].cell;
                let cell = &mut tour.stops[index].cell;
                *cell = Cell::new((cell.x + other.x) / 2, (cell.y + other.y) / 2);
            }
            _ => {
                let other = rng.random_range(0..count);
                tour.stops[index.min(other)..=index.max(other)].reverse();
            }
        }
    }

    fn nudge(&self, stop: &mut Stop, rng: &mut impl Rng) {
        let by = if rng.random_range(0..4) == 0 { 3 } else { 1 };
        self.shift(stop, by, rng);
    }

    fn shift(&self, stop: &mut Stop, by: i16, rng: &mut impl Rng) {
        let to =
            Cell::new(stop.cell.x + rng.random_range(-by..=by), stop.cell.y + rng.random_range(-by..=by));
        if self.known.grid().contains(to) {
            stop.cell = to;
        }
    }

    /// A stop where much is heard, or near a device that still has data.
    fn insert(&self, tour: &mut Tour, rng: &mut impl Rng) {
        let devices = self.known.devices();
        if tour.stops.len() >= STOPS_MAX || devices.is_empty() {
            return;
        }
        let east_first = rng.random();
        let stop = if rng.random() {
            Stop { cell: self.known.busy_cell(rng), slots: rng.random_range(0..=30), east_first }
        } else {
            let device = rng.random_range(0..devices.len());
            if self.state.remaining[device] <= 0.0 {
                return;
            }
            let mut stop = Stop { cell: devices[device], slots: rng.random_range(0..=12), east_first };
            if rng.random() {
                self.nudge(&mut stop, rng);
            }
            stop
        };
        tour.stops.insert(rng.random_range(0..=tour.stops.len()), stop);
    }
}
