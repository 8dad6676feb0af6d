//! Cheapest paths over states (cell, set of required visits made), by A* (Hart, Nilsson and Raphael 1968).

use super::Mission;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The cells that a path may use, and the visits that it must make.
pub(super) struct Region {
    /// By cell: whether the path may enter it.
    pub allowed: Vec<bool>,
    /// By cell: the required visits that the cell counts as, one bit each.
    pub satisfies: Vec<u32>,
    /// The bits of all required visits.
    pub required: u32,
}

/// The state table of the search. It is reused from search to search.
#[derive(Default)]
pub(super) struct Paths {
    search: u32,
    states: Vec<Label>,
}

/// The cheapest path known to a state.
#[derive(Clone, Copy, Default)]
struct Label {
    /// The search that wrote this label; labels of earlier searches are void.
    search: u32,
    /// The state before; `u32::MAX` at the start.
    from: u32,
    cost: f64,
    is_final: bool,
}

/// States to expand, the least estimated total cost first. Costs are not negative, so their bit patterns sort like
/// their values.
type Frontier = BinaryHeap<Reverse<(u64, u32)>>;

impl Paths {
    /// The cheapest path from the start into the terminal that makes all required visits: its cost, and the cells that it
    /// leaves, last first. Leaving a cell costs `costs[cell] > 0`.
    pub fn cheapest(
        &mut self,
        mission: &Mission,
        region: &Region,
        costs: &[f64],
    ) -> Option<(f64, Vec<usize>)> {
        let cells = costs.len();
        let estimate = Estimate::new(mission, region, costs);
        let states = cells * (region.required as usize + 1);
        if self.states.len() < states {
            self.states.resize(states, Label::default());
        }
        self.search += 1;
        let mut frontier = Frontier::new();
        let first = region.satisfies[mission.start] as usize * cells + mission.start;
        self.states[first] = Label { search: self.search, from: u32::MAX, cost: 0.0, is_final: false };
        frontier.push(Reverse((estimate.at(first).to_bits(), first as u32)));
        let mut end: Option<(f64, usize)> = None;
        while let Some(Reverse((total, state))) = frontier.pop() {
            let state = state as usize;
            if end.is_some_and(|(cost, _)| cost.to_bits() <= total) {
                break;
            }
            let label = &mut self.states[state];
            if std::mem::replace(&mut label.is_final, true) {
                continue;
            }
            let (cell, visits) = (state % cells, (state / cells) as u32);
            let cost = label.cost + costs[cell];
            for &next in &mission.neighbours[cell] {
                if next == mission.terminal {
                    if visits == region.required && end.is_none_or(|(least, _)| cost < least) {
                        end = Some((cost, state));
                    }
                    continue;
                }
                if !region.allowed[next] {
                    continue;
                }
                let to = (visits | region.satisfies[next]) as usize * cells + next;
                let known = &mut self.states[to];
                if known.search != self.search || (cost < known.cost && !known.is_final) {
                    *known = Label { search: self.search, from: state as u32, cost, is_final: false };
                    let total = cost + estimate.at(to);
                    if total.is_finite() {
                        frontier.push(Reverse((total.to_bits(), to as u32)));
                    }
                }
            }
        }
        let (cost, last) = end?;
        let before = |&state: &usize| Some(self.states[state].from).filter(|&from| from != u32::MAX);
        let path = std::iter::successors(Some(last), |state| before(state).map(|from| from as usize));
        Some((cost, path.map(|state| state % cells).collect()))
    }
}

/// The admissible estimate of the cost that remains: the cost home, or through one of the missing visits and then home,
/// whichever is largest.
struct Estimate {
    cells: usize,
    required: u32,
    /// By cell: the least cost into the terminal.
    home: Vec<f64>,
    /// By required visit and cell: the least cost into the terminal through a cell that counts as the visit.
    through: Vec<Vec<f64>>,
}

impl Estimate {
    fn new(mission: &Mission, region: &Region, costs: &[f64]) -> Estimate {
        let last = mission.neighbours[mission.terminal].iter();
        let home = least_costs(mission, region, costs, last.map(|&cell| (cell, costs[cell])));
        let through = |bit: u32| {
            let visits = (0..costs.len()).filter(|&cell| region.satisfies[cell] >> bit & 1 == 1);
            least_costs(mission, region, costs, visits.map(|cell| (cell, home[cell])))
        };
        let through = (0..region.required.count_ones()).map(through).collect();
        Estimate { cells: costs.len(), required: region.required, home, through }
    }

    fn at(&self, state: usize) -> f64 {
        let (cell, visits) = (state % self.cells, (state / self.cells) as u32);
        let missing = self.required & !visits;
        let through = self.through.iter().enumerate().filter(|(bit, _)| missing >> bit & 1 == 1);
        through.map(|(_, costs)| costs[cell]).fold(self.home[cell], f64::max)
    }
}

/// The least cost from each cell, over allowed cells, to one of the `targets`, each with the cost that remains there
/// (Dijkstra 1959).
fn least_costs(
    mission: &Mission,
    region: &Region,
    costs: &[f64],
    targets: impl Iterator<Item = (usize, f64)>,
) -> Vec<f64> {
    let mut least = vec![f64::INFINITY; costs.len()];
    let mut frontier = Frontier::new();
    for (cell, cost) in targets.filter(|&(cell, cost)| region.allowed[cell] && cost.is_finite()) {
        least[cell] = cost;
        frontier.push(Reverse((cost.to_bits(), cell as u32)));
    }
    while let Some(Reverse((cost, cell))) = frontier.pop() {
        let cell = cell as usize;
        if least[cell].to_bits() < cost {
            continue;
        }
        for &before in mission.neighbours[cell].iter().filter(|&&before| region.allowed[before]) {
            let cost = least[cell] + costs[before];
            if cost < least[before] {
                least[before] = cost;
                frontier.push(Reverse((cost.to_bits(), before as u32)));
            }
        }
    }
    least
}
