//! The teacher of the distillation: a planner with full knowledge of map, channel and devices, whose decisions a student
//! can learn from the policy's observation.
//!
//! A plan is a sequence of stops, each a device and a radius, and then the terminal. At a stop the aircraft flies to within
//! the radius of the device and hovers until the device is empty. The value of a plan is its utility in a mean flight: in
//! each slot the device with the highest mean SNR sends at its expected rate. Local search over insertions, removals,
//! moves and reversals of stops, and over their radii, finds the plan.
//!
//! The search of [`crate::planner`] finds better tours but is the worse teacher. It hovers at any cell, and it is random;
//! neither can be predicted from the observation. After 6,000 updates (RD, w = (1, 0)) its students collected 68 % of the
//! data, and the students of this planner 72 %.

use crate::env::distribution::Distribution;
use crate::env::flight::Flight;
use crate::env::greedy::approach;
use crate::planner::known::Rates;
use gleaner_guard::Guard;
use gleaner_policy::Preference;
use gleaner_units::{Action, Cell, Grid};
use gleaner_world::{Realization, World};
use std::sync::Arc;

/// A device with less data counts as empty, data units: a thousandth of its initial data.
const EMPTY_UNITS: f32 = 5.0;
/// Least expected rate at a stop, data units per slot: a link without buildings in between.
const NEAR_UNITS: f32 = 300.0;
/// Temperature of the labels: a loss of this utility divides the probability of an action by e.
const LABEL_TEMPERATURE: f32 = 0.1;
/// Largest weight of data in the utility. With data alone, all tours that use up the battery would be equal.
const W_DATA_MAX: f32 = 0.9;
/// Initial orders of all stops in the first search, each in both directions.
const RESTARTS: usize = 3;
/// Radii of a stop, cells.
const RADII: [u32; 5] = [0, 1, 2, 4, 6];
/// Radius of a stop when it is inserted, cells.
const FIRST_RADIUS: u32 = 2;
/// Least gain of a change that the local search accepts, utility.
const GAIN_MIN: f32 = 1e-3;

/// A device to visit, and the radius within which to hover. A larger radius saves moves and lowers the rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stop {
    device: usize,
    radius: u32,
}

/// Studies missions.
#[derive(Debug)]
pub struct Teacher {
    rates: Rates,
}

/// The teacher's model of one mission: per device and cell, mean SNR (dB) and expected data per slot.
#[derive(Clone, Debug)]
pub struct Course {
    grid: Grid,
    links: Vec<Vec<(f32, f32)>>,
    initial_units: f32,
    tour: Option<Vec<Stop>>,
}

/// The state from which a plan starts.
struct Start<'a> {
    cell: Cell,
    battery: f32,
    remaining: Vec<f32>,
    guard: &'a Guard,
    preference: Preference,
}

/// A flight with expected rates in place of random ones.
struct MeanFlight {
    cell: Cell,
    battery: f32,
    remaining: Vec<f32>,
    collected: f32,
    energy: f32,
    moved: bool,
    first: Option<Action>,
}

impl MeanFlight {
    fn begin(start: &Start<'_>) -> MeanFlight {
        MeanFlight {
            cell: start.cell,
            battery: start.battery,
            remaining: start.remaining.clone(),
            collected: 0.0,
            energy: 0.0,
            moved: false,
            first: None,
        }
    }
}

impl Teacher {
    /// Tabulates the channel.
    #[must_use]
    pub fn new(world: Arc<World>) -> Teacher {
        Teacher { rates: Rates::new(world) }
    }

    /// The model of a mission.
    #[must_use]
    pub fn study(&self, realization: &Realization) -> Course {
        let grid = self.rates.grid();
        let links = realization
            .devices()
            .iter()
            .map(|device| grid.cells().map(|uav| self.rates.link(device.cell, uav)).collect())
            .collect();
        let initial_units = realization.devices().iter().map(|device| device.data_units).sum();
        Course { grid, links, initial_units, tour: None }
    }
}

impl Course {
    /// The first action, inside the guard's mask, of the best tour found from the flight's present state. The next search
    /// starts from this tour.
    ///
    /// # Panics
    /// When the flight is over.
    #[must_use]
    pub fn advise(&mut self, flight: &Flight) -> Action {
        self.plan(flight).0
    }

    /// [`Course::advise`], and a label: the softmax of the utilities of the allowed actions, each followed by the tour. Actions
    /// that lose no utility share the probability.
    ///
    /// # Panics
    /// When the flight is over.
    #[must_use]
    pub fn teach(&mut self, flight: &Flight) -> (Action, [f32; Action::COUNT]) {
        let (advice, start, devices) = self.plan(flight);
        let tour = self.tour.clone().unwrap_or_default();
        let guard = flight.guard();
        let mut utilities = [f32::NEG_INFINITY; Action::COUNT];
        for action in flight.mask().iter() {
            let mut next = MeanFlight::begin(&start);
            self.slot(&mut next, action);
            let ends = action != Action::Hover && next.cell == guard.terminal();
            if !ends {
                self.finish(&mut next, guard, &devices, &tour);
            }
            utilities[action.index()] = self.utility(&start, &next);
        }
        (advice, Distribution::label(utilities, LABEL_TEMPERATURE, advice, flight.mask()).probability)
    }

    fn plan<'a>(&mut self, flight: &'a Flight) -> (Action, Start<'a>, Vec<Cell>) {
        let episode = flight.episode();
        let start = Start {
            cell: episode.uav(),
            battery: episode.battery().0,
            remaining: episode.devices().iter().map(|device| device.remaining_units).collect(),
            guard: flight.guard(),
            preference: flight.preference(),
        };
        let devices: Vec<Cell> = episode.devices().iter().map(|device| device.cell).collect();
        let tour = self.search(&start, &devices);
        let (_, first) = self.fly(&start, &devices, &tour);
        self.tour = Some(tour);
        let mask = flight.mask();
        let advice = first
            .filter(|&action| mask.allows(action))
            .or_else(|| flight.guard().homeward(start.cell).filter(|&action| mask.allows(action)))
            .or_else(|| mask.iter().last())
            .expect("a feasible state has an allowed action");
        (advice, start, devices)
    }

    /// The best tour found: from the tour of the previous slot, or at first from no stops and from all stops in some orders.
    fn search(&self, start: &Start<'_>, devices: &[Cell]) -> Vec<Stop> {
        if let Some(tour) = &self.tour {
            let left =
                tour.iter().copied().filter(|stop| start.remaining[stop.device] > EMPTY_UNITS).collect();
            return self.improve(start, devices, left).1;
        }
        let mut initial_tours = vec![Vec::new()];
        for turn in 0..RESTARTS.min(devices.len()) {
            // By angle around the middle of the city, each time from another device.
            let middle = (f32::from(self.grid.width()) / 2.0, f32::from(self.grid.height()) / 2.0);
            let angle = |device: &usize| {
                libm::atan2f(
                    f32::from(devices[*device].y) - middle.1,
                    f32::from(devices[*device].x) - middle.0,
                )
            };
            let mut order: Vec<usize> =
                (0..devices.len()).filter(|&device| start.remaining[device] > EMPTY_UNITS).collect();
            order.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
            if !order.is_empty() {
                let by = turn * order.len() / RESTARTS.min(devices.len());
                order.rotate_left(by);
            }
            let stops =
                |order: &[usize]| order.iter().map(|&device| Stop { device, radius: FIRST_RADIUS }).collect();
            initial_tours.push(stops(&order));
            order.reverse();
            initial_tours.push(stops(&order));
        }
        let found = initial_tours.into_iter().map(|tour| self.improve(start, devices, tour));
        found.reduce(|a, b| if b.0 > a.0 { b } else { a }).map_or_else(Vec::new, |(_, tour)| tour)
    }

    /// Steepest ascent: applies the best change until no change improves the tour. Returns the utility and the tour.
    fn improve(&self, start: &Start<'_>, devices: &[Cell], mut tour: Vec<Stop>) -> (f32, Vec<Stop>) {
        let mut best = self.fly(start, devices, &tour).0;
        loop {
            let mut improved = None;
            for candidate in changes(&tour, &start.remaining) {
                let value = self.fly(start, devices, &candidate).0;
                if value > best + GAIN_MIN {
                    best = value;
                    improved = Some(candidate);
                }
            }
            match improved {
                Some(candidate) => tour = candidate,
                None => return (best, tour),
            }
        }
    }

    /// The utility `w . (percent, -energy)` of a tour's mean flight, and its first action.
    fn fly(&self, start: &Start<'_>, devices: &[Cell], tour: &[Stop]) -> (f32, Option<Action>) {
        let mut flight = MeanFlight::begin(start);
        self.finish(&mut flight, start.guard, devices, tour);
        (self.utility(start, &flight), flight.first)
    }

    /// Flies the stops as far as the battery allows, then to the terminal.
    fn finish(&self, flight: &mut MeanFlight, guard: &Guard, devices: &[Cell], tour: &[Stop]) {
        let distance = |cell: Cell| guard.distance(cell).map_or(f32::INFINITY, f32::from);
        let affordable = |flight: &MeanFlight, action: Action| {
            let next = flight.cell.after(action);
            let needed = if next == guard.terminal() { 2.0 } else { distance(next) };
            flight.battery - action.cost().0 >= needed
        };
        'tour: for &Stop { device, radius } in tour {
            while flight.remaining[device] > EMPTY_UNITS {
                let is_near =
                    flight.cell.manhattan(devices[device]) <= radius && self.is_fast(flight.cell, device);
                let approach = approach(flight.cell, devices[device]).filter(|_| !is_near);
                let action = approach.unwrap_or(Action::Hover);
                if !affordable(flight, action) {
                    break 'tour;
                }
                self.slot(flight, action);
                // A move into the terminal ends the mission.
                if flight.cell == guard.terminal() && action != Action::Hover {
                    break 'tour;
                }
            }
        }
        if flight.cell == guard.terminal() && !flight.moved {
            // Only a move into the terminal ends the mission, so the aircraft leaves it and returns.
            let out = Action::MOVES.into_iter().find(|&out| distance(flight.cell.after(out)) == 1.0);
            if let Some(out) = out {
                self.slot(flight, out);
            }
        }
        while let Some(action) = homeward(guard, flight.cell) {
            self.slot(flight, action);
        }
    }

    fn utility(&self, start: &Start<'_>, flight: &MeanFlight) -> f32 {
        let percent = 100.0 * flight.collected / self.initial_units;
        let w_data = start.preference.w_data().min(W_DATA_MAX);
        w_data * percent - (1.0 - w_data) * flight.energy
    }

    fn slot(&self, flight: &mut MeanFlight, action: Action) {
        flight.collected += self.serve(flight.cell, &mut flight.remaining);
        flight.cell = flight.cell.after(action);
        flight.battery -= action.cost().0;
        flight.energy += action.cost().0;
        flight.moved |= action != Action::Hover;
        flight.first = flight.first.or(Some(action));
    }

    /// Whether the expected rate suffices for a stop.
    fn is_fast(&self, cell: Cell, device: usize) -> bool {
        self.grid.index(cell).is_some_and(|place| self.links[device][place].1 > NEAR_UNITS)
    }

    /// One slot of a mean flight: of the devices with data, the one with the highest mean SNR sends.
    fn serve(&self, cell: Cell, remaining: &mut [f32]) -> f32 {
        let Some(place) = self.grid.index(cell) else { return 0.0 };
        let mut served: Option<(usize, f32, f32)> = None;
        for (device, links) in self.links.iter().enumerate() {
            let (snr_db, rate) = links[place];
            if remaining[device] > 0.0 && rate > 0.0 && served.is_none_or(|(_, best, _)| snr_db > best) {
                served = Some((device, snr_db, rate));
            }
        }
        served.map_or(0.0, |(device, _, rate)| {
            let sent = rate.min(remaining[device]);
            remaining[device] -= sent;
            sent
        })
    }
}

/// The neighbourhood of a tour: one stop inserted, removed or moved, another radius, or a part reversed.
fn changes(tour: &[Stop], remaining: &[f32]) -> Vec<Vec<Stop>> {
    let mut changed = Vec::new();
    let mut change = |edit: &dyn Fn(&mut Vec<Stop>)| {
        let mut other = tour.to_vec();
        edit(&mut other);
        changed.push(other);
    };
    for device in (0..remaining.len()).filter(|&device| remaining[device] > EMPTY_UNITS) {
        match tour.iter().position(|stop| stop.device == device) {
            None => {
                for place in 0..=tour.len() {
                    change(&|other| other.insert(place, Stop { device, radius: FIRST_RADIUS }));
                }
            }
            Some(place) => {
                change(&|other| {
                    other.remove(place);
                });
                for to in (0..tour.len()).filter(|&to| to != place) {
                    change(&|other| {
                        let stop = other.remove(place);
                        other.insert(to, stop);
                    });
                }
                for radius in RADII.into_iter().filter(|&radius| radius != tour[place].radius) {
                    change(&|other| other[place].radius = radius);
                }
            }
        }
    }
    for first in 0..tour.len() {
        for last in first + 1..tour.len() {
            change(&|other| other[first..=last].reverse());
        }
    }
    changed
}

/// The next move to the terminal, along the longer axis where the fence allows it.
fn homeward(guard: &Guard, cell: Cell) -> Option<Action> {
    let here = guard.distance(cell)?;
    let shortens = |action: &Action| guard.distance(cell.after(*action)).is_some_and(|there| there < here);
    approach(cell, guard.terminal()).filter(shortens).or_else(|| guard.homeward(cell))
}
