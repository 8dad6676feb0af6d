//! What nobody can exceed: an upper bound on the data of a mission.
//!
//! The oracle is a plan, so the best that is possible lies above it. How far at most, a bound says. It comes from branch
//! and bound (Land and Doig 1960) over a Lagrangian relaxation (Geoffrion 1974).
//!
//! **Relaxation.** A mission is a walk over cells, slots of hovering on the way, and in each slot one device that sends.
//! Two rules are given up and paid for instead: the battery costs `m` per unit, and of what device `k` holds a unit is
//! worth `p_k` to the walk, the rest of it being counted at once. A slot at cell `c` is then worth `max_k p_k r_k(c)`, with
//! `r_k` the device's rate there. Where `p_k` times the device's fastest rate is at most `m / 2`, which is what a slot of
//! hovering costs, hovering never pays, and what remains is a walk whose moves cost `m` less what their slots are worth:
//! a cheapest path. For all such prices
//!
//! ```text
//! data <= m B + sum_k (1 - p_k) D_k - cheapest walk
//! ```
//!
//! **Branching.** That alone proves nothing, because hovering is paid as if it were always done at the best place of
//! all. So missions are told apart by the fastest rate at which they hear each device: a range for each. Then no cell that
//! hears it faster may be entered, which makes hovering dearer, and one that hears it faster than the range begins must
//! be: the walk is a cheapest path over cells and sets of devices that it has been near to (Held and Karp 1962). The
//! missions whose bound is highest are split until the effort is spent. The highest bound that is left holds for all.
//!
//! What is bounded is the mission in the mean, as the oracle plans it: a slot brings its link's expected rate. Who sees
//! a slot's shadowing before choosing what to do next may have a little more.

use crate::planner::known::Rates;
use gleaner_units::Action;
use gleaner_world::{Placement, Realization};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// Prices that are tried for each part.
const ROUNDS: u32 = 6;
/// A step of the prices aims at this share of the best bound so far (Polyak 1969).
const AIM: f64 = 0.97;
/// What a battery unit costs at first, data units; what steps of the price are measured in.
const PRICE: f64 = 300.0;
/// The battery's price stays below it: nobody collects as much with a unit.
const PRICE_MAX: f64 = 2_000.0;
/// A device that is heard slower than this, data units per slot, is hardly heard.
const HARDLY: f64 = 20.0;
/// Where the walk hears a device slower than this share of the fastest, the missions are split at the share after it.
const FAR: f64 = 0.4;
const FAR_SPLIT: f64 = 0.45;
/// Rounding of the sums must not make a bound too low.
const ROUNDING: f64 = 1e-9;

/// Percent of the data that no plan can exceed. The search ends when it has proven that `reached_percent`, which some
/// plan brings, is the best, or when it has looked at so many parts of all missions.
#[must_use]
pub fn upper_bound_percent(
    rates: &Rates,
    realization: &Realization,
    reached_percent: f32,
    parts: u32,
) -> f32 {
    let mission = Mission::new(rates, realization);
    let all: f64 = mission.data.iter().sum();
    if all <= 0.0 {
        return 100.0;
    }
    let bound = mission.bound(all * f64::from(reached_percent) / 100.0, parts);
    (100.0 * bound / all).min(100.0) as f32
}

/// What the bound is made from. Cells are numbered as the grid does.
struct Mission {
    /// Of each device in each cell, data units per slot.
    rates: Vec<Vec<f64>>,
    /// What each device holds, data units.
    data: Vec<f64>,
    /// Battery units.
    battery: f64,
    start: usize,
    /// A move into it is the last.
    terminal: usize,
    neighbours: Vec<Vec<usize>>,
}

/// Some of all missions, by the fastest rate at which they hear each device.
#[derive(Clone)]
struct Part {
    /// It is higher than this, by device; nothing is asked where this is nothing.
    above: Vec<f64>,
    /// It is not higher than this.
    at_most: Vec<f64>,
    /// The fastest rate that is possible.
    fastest: Vec<f64>,
    prices: Prices,
    /// What these missions bring at most, data units.
    bound: f64,
    /// The fastest rate on the walk that the bound comes from.
    heard: Vec<f64>,
}

/// What the rules that were given up cost.
#[derive(Clone)]
struct Prices {
    /// Of a battery unit, data units.
    battery: f64,
    /// Of each device's data: the share of the highest price at which hovering does not pay.
    data: Vec<f64>,
}

/// The cheapest walk.
struct Walk {
    cost: f64,
    moves: f64,
    /// The fastest rate on it, by device.
    heard: Vec<f64>,
    /// What each device would send in its slots if it never ran out.
    sent: Vec<f64>,
}

/// Where a part allows to fly, and what it asks for.
struct Way {
    allowed: Vec<bool>,
    /// The devices that a cell counts for as having been near to, as bits.
    near: Vec<u32>,
    /// All bits that are asked for.
    asked: u32,
}

impl Mission {
    fn new(rates: &Rates, realization: &Realization) -> Mission {
        let grid = rates.grid();
        let index = |cell| grid.index(cell).expect("a realization lies on its grid");
        let devices = realization.devices();
        let heard = |device: &Placement| {
            grid.cells().map(|uav| f64::from(rates.units_per_slot(device.cell, uav))).collect()
        };
        Mission {
            rates: devices.iter().map(heard).collect(),
            data: devices.iter().map(|device| f64::from(device.data_units)).collect(),
            battery: f64::from(realization.battery().0),
            start: index(realization.start()),
            terminal: index(realization.terminal()),
            neighbours: grid
                .cells()
                .map(|cell| Action::MOVES.into_iter().filter_map(|to| grid.index(cell.after(to))).collect())
                .collect(),
        }
    }

    /// The highest bound of all parts after so many were looked at, or `reached` when nothing higher is left.
    fn bound(&self, reached: f64, parts: u32) -> f64 {
        let mut paths = Paths::default();
        let mut everything = Part {
            above: vec![0.0; self.data.len()],
            at_most: vec![f64::INFINITY; self.data.len()],
            fastest: Vec::new(),
            prices: Prices { battery: PRICE, data: vec![1.0; self.data.len()] },
            bound: self.data.iter().sum(),
            heard: Vec::new(),
        };
        let mut open = BinaryHeap::new();
        if everything.bound > reached && self.relax(&mut everything, reached, &mut paths) {
            open.push(everything);
        }
        let mut looked_at = 1;
        while looked_at < parts
            && let Some(part) = open.peek()
            && let Some((device, rate)) = self.split(part)
        {
            let Some(part) = open.pop() else { break };
            let (mut slower, mut faster) = (part.clone(), part);
            slower.at_most[device] = rate;
            faster.above[device] = rate;
            for mut part in [slower, faster] {
                looked_at += 1;
                if self.relax(&mut part, reached, &mut paths) {
                    open.push(part);
                }
            }
        }
        open.peek().map_or(reached, |part| part.bound)
    }

    /// Where to split a part: the device that would cost the walk most if it had to hover where it is, and a rate between
    /// what the walk hears and what it is paid for. `None` if it is paid for nothing but what it hears.
    fn split(&self, part: &Part) -> Option<(usize, f64)> {
        let heard = |device: usize| part.heard[device].max(part.above[device]);
        let missing = |device: usize| {
            let [slow, fast] = [heard(device).max(HARDLY), part.fastest[device]];
            if slow < fast { self.data[device] * (1.0 / slow - 1.0 / fast) } else { 0.0 }
        };
        let device = (0..self.data.len()).max_by(|&a, &b| missing(a).total_cmp(&missing(b)))?;
        let [slow, fast] = [heard(device), part.fastest[device]];
        let rate = if slow < FAR * fast { FAR_SPLIT * fast } else { (slow * fast).sqrt() };
        (missing(device) > 0.0).then_some((device, rate))
    }

    /// Lowers the part's bound to what its best prices prove; `false` if it holds no mission that brings more than
    /// `reached`.
    fn relax(&self, part: &mut Part, reached: f64, paths: &mut Paths) -> bool {
        let way = self.way(part);
        part.fastest = self.rates.iter().map(|rates| fastest(rates, &way.allowed)).collect();
        let asks_too_much =
            part.above.iter().zip(&part.fastest).any(|(&above, &fastest)| above > 0.0 && fastest <= above);
        if asks_too_much || !way.allowed[self.start] {
            return false;
        }
        let is_heard = |device: usize| part.fastest[device] > 0.0;
        let heard: f64 =
            (0..self.data.len()).filter(|&device| is_heard(device)).map(|device| self.data[device]).sum();
        part.bound = part.bound.min(heard);
        let mut prices = part.prices.clone();
        let mut best = f64::INFINITY;
        for round in 0..ROUNDS {
            // In data units for each data unit; at these prices hovering does not pay.
            let highest = |device: usize| prices.battery / (2.0 * part.fastest[device]);
            let worth: Vec<f64> =
                (0..self.data.len())
                    .map(|device| {
                        if is_heard(device) { (prices.data[device] * highest(device)).min(1.0) } else { 1.0 }
                    })
                    .collect();
            let Some(walk) = self.cheapest_walk(&way, &worth, prices.battery, paths) else { return false };
            let counted: f64 = worth.iter().zip(&self.data).map(|(worth, data)| (1.0 - worth) * data).sum();
            let bound = (prices.battery * self.battery + counted - walk.cost) * (1.0 + ROUNDING);
            if bound < best {
                best = bound;
                part.prices = prices.clone();
                part.heard.clone_from(&walk.heard);
            }
            if best <= reached {
                return false;
            }
            // Down the subgradient: what the rules are broken by.
            let mut slope = self.battery - walk.moves;
            let mut slopes = vec![0.0; self.data.len()];
            for device in (0..self.data.len()).filter(|&device| is_heard(device)) {
                let too_much = walk.sent[device] - self.data[device];
                let is_whole = worth[device] >= 1.0;
                if !is_whole {
                    slope += prices.data[device] * too_much / (2.0 * part.fastest[device]);
                }
                if !is_whole || too_much > 0.0 {
                    slopes[device] = highest(device) * too_much;
                }
            }
            let length = (PRICE * slope).powi(2) + slopes.iter().map(|slope| slope * slope).sum::<f64>();
            let step =
                (bound - reached.max(AIM * best)) / length.max(ROUNDING) / (1.0 + 0.1 * f64::from(round));
            prices.battery = (prices.battery - step * slope * PRICE * PRICE).clamp(1.0, PRICE_MAX);
            for (price, slope) in prices.data.iter_mut().zip(&slopes) {
                *price = (*price - step * slope).clamp(0.0, 1.0);
            }
        }
        part.bound = part.bound.min(best);
        true
    }

    fn way(&self, part: &Part) -> Way {
        let cells = self.neighbours.len();
        let ranges = || self.rates.iter().zip(&part.above).zip(&part.at_most);
        let mut way = Way { allowed: vec![true; cells], near: vec![0; cells], asked: 0 };
        // Nothing is sent from the terminal: the move into it is the end.
        way.allowed[self.terminal] = self.start == self.terminal;
        for ((rates, &above), &at_most) in ranges() {
            let bit = if above > 0.0 { way.asked + 1 } else { 0 };
            way.asked |= bit;
            for ((&rate, allowed), near) in rates.iter().zip(&mut way.allowed).zip(&mut way.near) {
                *allowed &= rate <= at_most;
                *near |= if rate > above { bit } else { 0 };
            }
        }
        way
    }

    fn cheapest_walk(&self, way: &Way, worth: &[f64], battery: f64, paths: &mut Paths) -> Option<Walk> {
        // What each slot is worth, and who sends in it.
        let slots: Vec<(f64, usize)> = (0..self.neighbours.len())
            .map(|cell| {
                let offers = worth.iter().zip(&self.rates).map(|(worth, rates)| worth * rates[cell]);
                offers.enumerate().fold(
                    (0.0, 0),
                    |best, (device, units)| {
                        if units > best.0 { (units, device) } else { best }
                    },
                )
            })
            .collect();
        let costs: Vec<f64> = slots.iter().map(|slot| battery - slot.0).collect();
        let (cost, cells) = paths.cheapest(self, way, &costs)?;
        let mut walk = Walk {
            cost,
            moves: cells.len() as f64,
            heard: vec![0.0; self.data.len()],
            sent: vec![0.0; self.data.len()],
        };
        for cell in cells {
            for (heard, rates) in walk.heard.iter_mut().zip(&self.rates) {
                *heard = heard.max(rates[cell]);
            }
            let (units, device) = slots[cell];
            if units > 0.0 {
                walk.sent[device] += self.rates[device][cell];
            }
        }
        Some(walk)
    }
}

fn fastest(rates: &[f64], allowed: &[bool]) -> f64 {
    rates.iter().zip(allowed).filter(|(_, allowed)| **allowed).map(|(rate, _)| *rate).fold(0.0, f64::max)
}

/// The part with the highest bound is the greatest.
impl Ord for Part {
    fn cmp(&self, other: &Part) -> Ordering {
        self.bound.total_cmp(&other.bound)
    }
}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Part) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Part) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Part {}

/// Cheapest paths over (cell, devices that were near), by A* (Hart, Nilsson and Raphael 1968), in memory that is used
/// again.
#[derive(Default)]
struct Paths {
    search: u32,
    states: Vec<Arrival>,
}

/// How a state was come to.
#[derive(Clone, Copy, Default)]
struct Arrival {
    /// The search that this belongs to.
    search: u32,
    from: u32,
    cost: f64,
    is_final: bool,
}

/// What is to be looked at, the least cost first: costs are not negative, so their bits are in order.
type Frontier = BinaryHeap<Reverse<(u64, u32)>>;

impl Paths {
    /// The cost of the cheapest way from the start into the terminal which has been near to all that is asked for, and
    /// the cells it leaves, the last first. A cell costs what leaving it costs, more than nothing.
    fn cheapest(&mut self, mission: &Mission, way: &Way, costs: &[f64]) -> Option<(f64, Vec<usize>)> {
        let cells = costs.len();
        let ahead = Ahead::new(mission, way, costs);
        let states = cells * (way.asked as usize + 1);
        if self.states.len() < states {
            self.states.resize(states, Arrival::default());
        }
        self.search += 1;
        let mut frontier = Frontier::new();
        let first = way.near[mission.start] as usize * cells + mission.start;
        self.states[first] = Arrival { search: self.search, from: u32::MAX, cost: 0.0, is_final: false };
        frontier.push(Reverse((ahead.of(first).to_bits(), first as u32)));
        let mut end: Option<(f64, usize)> = None;
        while let Some(Reverse((whole, state))) = frontier.pop() {
            let state = state as usize;
            if end.is_some_and(|(cost, _)| cost.to_bits() <= whole) {
                break;
            }
            let arrival = &mut self.states[state];
            if std::mem::replace(&mut arrival.is_final, true) {
                continue;
            }
            let (cell, near) = (state % cells, (state / cells) as u32);
            let cost = arrival.cost + costs[cell];
            for &next in &mission.neighbours[cell] {
                if next == mission.terminal {
                    if near == way.asked && end.is_none_or(|(least, _)| cost < least) {
                        end = Some((cost, state));
                    }
                    continue;
                }
                if !way.allowed[next] {
                    continue;
                }
                let to = (near | way.near[next]) as usize * cells + next;
                let known = &mut self.states[to];
                if known.search != self.search || (cost < known.cost && !known.is_final) {
                    *known = Arrival { search: self.search, from: state as u32, cost, is_final: false };
                    let whole = cost + ahead.of(to);
                    if whole.is_finite() {
                        frontier.push(Reverse((whole.to_bits(), to as u32)));
                    }
                }
            }
        }
        let (cost, last) = end?;
        let back = |&state: &usize| Some(self.states[state].from).filter(|&from| from != u32::MAX);
        let path = std::iter::successors(Some(last), |state| back(state).map(|from| from as usize));
        Some((cost, path.map(|state| state % cells).collect()))
    }
}

/// What is still to be paid at least.
struct Ahead {
    cells: usize,
    asked: u32,
    /// From each cell into the terminal; and past a cell that is near to the device of each bit.
    home: Vec<f64>,
    past: Vec<Vec<f64>>,
}

impl Ahead {
    fn new(mission: &Mission, way: &Way, costs: &[f64]) -> Ahead {
        let last = mission.neighbours[mission.terminal].iter();
        let home = spread(mission, way, costs, last.map(|&cell| (cell, costs[cell])));
        let past = |bit: u32| {
            let near = (0..costs.len()).filter(|&cell| way.near[cell] >> bit & 1 == 1);
            spread(mission, way, costs, near.map(|cell| (cell, home[cell])))
        };
        let past = (0..way.asked.count_ones()).map(past).collect();
        Ahead { cells: costs.len(), asked: way.asked, home, past }
    }

    fn of(&self, state: usize) -> f64 {
        let (cell, near) = (state % self.cells, (state / self.cells) as u32);
        let missing = self.asked & !near;
        let past = self.past.iter().enumerate().filter(|(bit, _)| missing >> bit & 1 == 1);
        past.map(|(_, past)| past[cell]).fold(self.home[cell], f64::max)
    }
}

/// The least cost from every cell, over cells that are allowed, to one of these with what is to be paid from there
/// (Dijkstra 1959).
fn spread(mission: &Mission, way: &Way, costs: &[f64], from: impl Iterator<Item = (usize, f64)>) -> Vec<f64> {
    let mut least = vec![f64::INFINITY; costs.len()];
    let mut frontier = Frontier::new();
    for (cell, cost) in from.filter(|&(cell, cost)| way.allowed[cell] && cost.is_finite()) {
        least[cell] = cost;
        frontier.push(Reverse((cost.to_bits(), cell as u32)));
    }
    while let Some(Reverse((cost, cell))) = frontier.pop() {
        let cell = cell as usize;
        if least[cell].to_bits() < cost {
            continue;
        }
        for &before in mission.neighbours[cell].iter().filter(|&&before| way.allowed[before]) {
            let cost = least[cell] + costs[before];
            if cost < least[before] {
                least[before] = cost;
                frontier.push(Reverse((cost.to_bits(), before as u32)));
            }
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::evaluation::realizations;
    use crate::planner::{Effort, Problem, State, Tour};
    use gleaner_world::{ScenarioKind, World};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::sync::Arc;

    const SIDE: usize = 3;

    /// Nine cells, two devices that are heard here and there, a battery for at most ten slots.
    fn small(rng: &mut ChaCha8Rng) -> Mission {
        let mut rates = || {
            let rate = |_| if rng.random_bool(0.5) { rng.random_range(50.0_f64..700.0).round() } else { 0.0 };
            (0..SIDE * SIDE).map(rate).collect()
        };
        let rates = vec![rates(), rates()];
        let beside = |cell: usize| {
            let (x, y) = (cell % SIDE, cell / SIDE);
            let far = |other: &usize| (other % SIDE).abs_diff(x) + (other / SIDE).abs_diff(y) == 1;
            (0..SIDE * SIDE).filter(far).collect()
        };
        Mission {
            rates,
            data: vec![rng.random_range(300.0..2_000.0), rng.random_range(300.0..2_000.0)],
            battery: f64::from(rng.random_range(8..=10)) / 2.0,
            start: rng.random_range(0..SIDE * SIDE),
            terminal: rng.random_range(0..SIDE * SIDE),
            neighbours: (0..SIDE * SIDE).map(beside).collect(),
        }
    }

    /// The most that any mission brings, by trying all of them; `None` if the terminal is too far.
    fn most(mission: &Mission, cell: usize, half_units: i32, data: &[f64]) -> Option<f64> {
        let mut best: Option<f64> = None;
        for device in 0..data.len() {
            let sent = mission.rates[device][cell].min(data[device]);
            let mut left = data.to_vec();
            left[device] -= sent;
            let mut consider = |then: Option<f64>| {
                best = then.map_or(best, |then| Some(best.map_or(sent + then, |best| best.max(sent + then))));
            };
            if half_units >= 1 {
                consider(most(mission, cell, half_units - 1, &left));
            }
            for &next in mission.neighbours[cell].iter().filter(|_| half_units >= 2) {
                let then = if next == mission.terminal {
                    Some(0.0)
                } else {
                    most(mission, next, half_units - 2, &left)
                };
                consider(then);
            }
        }
        best
    }

    #[test]
    fn no_mission_brings_more_and_the_bound_is_near_the_best_one() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut loose, mut cases) = (0.0, 0);
        for _ in 0..60 {
            let mission = small(&mut rng);
            let Some(best) = most(&mission, mission.start, (2.0 * mission.battery) as i32, &mission.data)
            else {
                assert_eq!(mission.bound(0.0, 200), 0.0, "no mission is possible, so none brings anything");
                continue;
            };
            let [few, many] = [1, 200].map(|parts| mission.bound(0.0, parts));
            assert!(many >= best - 1e-6, "{many} is below {best}, which can be had");
            assert!(many <= few, "looking at more parts made the bound worse: {few} to {many}");
            loose += (many - best) / mission.data.iter().sum::<f64>();
            cases += 1;
        }
        assert!(cases > 40, "only {cases} missions were possible");
        let loose = loose / f64::from(cases);
        // With ten slots at most, hovering in parts of slots is worth something.
        assert!(loose < 0.07, "{loose:.3} of the data between the best mission and the bound, in the mean");
    }

    #[test]
    fn it_is_above_the_oracle_and_proves_that_not_all_can_be_had() {
        let world = Arc::new(World::default_world());
        let rates = Rates::new(Arc::clone(&world));
        let drawn = realizations(&world, &ScenarioKind::ReachDestination.scenario(), 5).unwrap();
        let bounds: Vec<f32> = drawn
            .iter()
            .map(|(_, realization)| {
                let (known, state) = (rates.study(realization), State::start(realization));
                let problem = Problem { known: &known, state: &state, w_data: 1.0 };
                let effort = Effort { tours: 2_000, temperatures: [5.0, 0.03] };
                let (reached, _) = problem.anneal(Tour::default(), effort, &mut ChaCha8Rng::seed_from_u64(0));
                let bound = upper_bound_percent(&rates, realization, reached, 200);
                assert!(bound >= reached - 1e-3, "{bound} % is proven and {reached} % reached");
                bound
            })
            .collect();
        // The second and the fifth are far from each other's devices.
        assert!(bounds[1] < 97.0 && bounds[4] < 97.0, "{bounds:?}");
    }
}
