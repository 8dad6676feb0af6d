//! An upper bound on the data of a mission, by branch and bound over a Lagrangian relaxation.
//!
//! The oracle's plan is a lower bound of the optimum. This module computes an upper bound, so that the two enclose it.
//! The method is branch and bound (Land and Doig 1960); each node is bounded by a Lagrangian relaxation (Geoffrion
//! 1974).
//!
//! # Model
//! A mission is a walk over cells. In each slot the aircraft hovers (half a battery unit) or moves (one unit), and one
//! device sends. A slot brings the expected rate of its link, as in the oracle's model. A flight that reacts to the
//! shadowing of each slot can collect slightly more than this model allows.
//!
//! # Relaxation
//! Two constraints are relaxed. The battery constraint gets a multiplier `m >= 0`, in data units per battery unit. The
//! constraint that device `k` sends at most its data `D_k` gets a multiplier `p_k` in 0..=1. A slot over cell `c` is then
//! worth `max_k p_k r_k(c)`, where `r_k(c)` is the rate of device `k` there. A slot of hovering costs `m / 2`. If
//! `p_k max_c r_k(c) <= m / 2` for every device, hovering never pays, and the relaxed problem is a cheapest path whose
//! edges cost `m` less the worth of a slot:
//!
//! ```text
//! data <= m B + sum_k (1 - p_k) D_k - cost of the cheapest path
//! ```
//!
//! A subgradient method minimises the right-hand side over the multipliers (`relaxation`, `multipliers`).
//!
//! # Branching
//! The relaxation values hovering as if it always happened at the best cell of the map, so the bound of the root node is
//! loose. Nodes therefore restrict the fastest rate at which the walk receives each device to an interval (`node`). A
//! cell that receives a device faster than the upper end is forbidden, which lowers `max_c r_k(c)` and permits larger
//! multipliers. A cell that receives it faster than the lower end must be visited, which makes the relaxed problem a
//! cheapest path over cells and sets of visited devices (Held and Karp 1962; `paths`). The node with the highest bound is
//! split until the node limit is reached. The highest bound of the open nodes holds for all missions.

mod multipliers;
mod node;
mod paths;
mod relaxation;
#[cfg(test)]
mod tests;

use super::known::Rates;
use gleaner_units::Action;
use gleaner_world::{Placement, Realization};
use node::Node;
use paths::Paths;
use std::collections::BinaryHeap;

/// The percentage of the data that no plan can exceed.
///
/// The search stops when the bound has reached `reached_percent`, the data of the best plan known (the incumbent), or
/// when it has evaluated `nodes` nodes.
#[must_use]
pub fn upper_bound_percent(
    rates: &Rates,
    realization: &Realization,
    reached_percent: f32,
    nodes: u32,
) -> f32 {
    let mission = Mission::new(rates, realization);
    let all: f64 = mission.data.iter().sum();
    if all <= 0.0 {
        return 100.0;
    }
    let bound = mission.bound(all * f64::from(reached_percent) / 100.0, nodes);
    (100.0 * bound / all).min(100.0) as f32
}

/// The problem that is bounded. Cells have the indices of the grid.
struct Mission {
    /// By device and cell, data units per slot.
    rates: Vec<Vec<f64>>,
    /// By device, data units at the start.
    data: Vec<f64>,
    /// Battery units at the start.
    battery: f64,
    start: usize,
    /// A move into this cell ends the mission.
    terminal: usize,
    neighbours: Vec<Vec<usize>>,
}

impl Mission {
    fn new(rates: &Rates, realization: &Realization) -> Mission {
        let grid = rates.grid();
        let index = |cell| grid.index(cell).expect("a realization lies on its grid");
        let devices = realization.devices();
        let rates_of = |device: &Placement| {
            grid.cells().map(|uav| f64::from(rates.units_per_slot(device.cell, uav))).collect()
        };
        Mission {
            rates: devices.iter().map(rates_of).collect(),
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

    /// The highest bound of the open nodes after `nodes` evaluations; the incumbent's data if no node is left open.
    fn bound(&self, incumbent: f64, nodes: u32) -> f64 {
        let mut paths = Paths::default();
        let mut open = BinaryHeap::new();
        let mut evaluated = 1;
        open.extend(self.evaluate(Node::root(self), incumbent, &mut paths));
        while evaluated < nodes
            && let Some(node) = open.peek()
            && let Some(branch) = node.branching(self)
            && let Some(node) = open.pop()
        {
            for child in node.split(branch) {
                evaluated += 1;
                open.extend(self.evaluate(child, incumbent, &mut paths));
            }
        }
        open.peek().map_or(incumbent, |node| node.bound)
    }
}
