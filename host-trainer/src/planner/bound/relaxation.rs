//! The Lagrangian relaxation of a node, minimised over its multipliers by a subgradient method.

use super::Mission;
use super::multipliers::{Multipliers, ROUNDING, Subgradient};
use super::node::Node;
use super::paths::{Paths, Region};

/// Subgradient steps per node.
const ROUNDS: u32 = 6;
/// The step length aims at this share of the best bound so far (Polyak 1969).
const TARGET_SHARE: f64 = 0.97;
/// The step length is divided by `1 + STEP_DECAY * round`.
const STEP_DECAY: f64 = 0.1;

/// The solution of the relaxed problem.
struct Walk {
    cost: f64,
    moves: f64,
    /// By device, the fastest rate on the walk.
    received: Vec<f64>,
    /// By device, what it sends on the walk if its data is unlimited, data units.
    sent: Vec<f64>,
}

impl Mission {
    /// The node with its bound lowered to that of the best multipliers found; `None` if it contains no mission that
    /// collects more than the incumbent.
    pub(super) fn evaluate(&self, mut node: Node, incumbent: f64, paths: &mut Paths) -> Option<Node> {
        let region = self.region(&node);
        node.fastest = self.rates.iter().map(|rates| fastest(rates, &region.allowed)).collect();
        let is_empty =
            node.above.iter().zip(&node.fastest).any(|(&above, &fastest)| above > 0.0 && fastest <= above);
        if is_empty || !region.allowed[self.start] {
            return None;
        }
        let receivable: f64 =
            self.data.iter().zip(&node.fastest).filter(|(_, rate)| **rate > 0.0).map(|(data, _)| data).sum();
        node.bound = node.bound.min(receivable);
        if node.bound <= incumbent {
            return None;
        }
        let mut multipliers = node.multipliers.clone();
        let mut best = f64::INFINITY;
        for round in 0..ROUNDS {
            let worth = self.worth(&multipliers, &node.fastest);
            let walk = self.cheapest_walk(&region, &worth, multipliers.battery, paths)?;
            let constant: f64 = worth.iter().zip(&self.data).map(|(worth, data)| (1.0 - worth) * data).sum();
            let bound = (multipliers.battery * self.battery + constant - walk.cost) * (1.0 + ROUNDING);
            if bound < best {
                best = bound;
                node.multipliers = multipliers.clone();
                node.received.clone_from(&walk.received);
            }
            if best <= incumbent {
                return None;
            }
            let subgradient = self.subgradient(&multipliers, &node.fastest, &worth, &walk);
            let gap = bound - incumbent.max(TARGET_SHARE * best);
            multipliers.step(&subgradient, gap / (1.0 + STEP_DECAY * f64::from(round)));
        }
        node.bound = node.bound.min(best);
        Some(node)
    }

    /// The multipliers `p_k` of the data constraints, in data units per data unit: at most 1, and small enough that
    /// hovering does not pay. 1 for a device that is not received anywhere.
    fn worth(&self, multipliers: &Multipliers, fastest: &[f64]) -> Vec<f64> {
        let of = |(&fastest, &share): (&f64, &f64)| {
            if fastest > 0.0 { (share * multipliers.battery / (2.0 * fastest)).min(1.0) } else { 1.0 }
        };
        fastest.iter().zip(&multipliers.data).map(of).collect()
    }

    /// By how much the walk violates each relaxed constraint, by the chain rule in the parameters of [`Multipliers`].
    fn subgradient(
        &self,
        multipliers: &Multipliers,
        fastest: &[f64],
        worth: &[f64],
        walk: &Walk,
    ) -> Subgradient {
        let mut slope = Subgradient { battery: self.battery - walk.moves, data: vec![0.0; self.data.len()] };
        for device in (0..self.data.len()).filter(|&device| fastest[device] > 0.0) {
            let excess = walk.sent[device] - self.data[device];
            let is_capped = worth[device] >= 1.0;
            if !is_capped {
                slope.battery += multipliers.data[device] * excess / (2.0 * fastest[device]);
            }
            if !is_capped || excess > 0.0 {
                slope.data[device] = multipliers.battery / (2.0 * fastest[device]) * excess;
            }
        }
        slope
    }

    /// The cells that the node allows, and the visits that it requires.
    fn region(&self, node: &Node) -> Region {
        let cells = self.neighbours.len();
        let mut region = Region { allowed: vec![true; cells], satisfies: vec![0; cells], required: 0 };
        // The move into the terminal ends the mission, so no slot is flown there unless the mission starts on it.
        region.allowed[self.terminal] = self.start == self.terminal;
        for ((rates, &above), &at_most) in self.rates.iter().zip(&node.above).zip(&node.at_most) {
            let bit = if above > 0.0 { region.required + 1 } else { 0 };
            region.required |= bit;
            let cells = region.allowed.iter_mut().zip(&mut region.satisfies);
            for (&rate, (allowed, satisfies)) in rates.iter().zip(cells) {
                *allowed &= rate <= at_most;
                *satisfies |= if rate > above { bit } else { 0 };
            }
        }
        region
    }

    fn cheapest_walk(&self, region: &Region, worth: &[f64], battery: f64, paths: &mut Paths) -> Option<Walk> {
        // By cell: the worth of a slot, and the device that sends in it.
        let slots: Vec<(f64, usize)> = (0..self.neighbours.len())
            .map(|cell| {
                let offers = worth.iter().zip(&self.rates).map(|(worth, rates)| worth * rates[cell]);
                let better = |best: (f64, usize), (device, units): (usize, f64)| {
                    if units > best.0 { (units, device) } else { best }
                };
                offers.enumerate().fold((0.0, 0), better)
            })
            .collect();
        let costs: Vec<f64> = slots.iter().map(|slot| battery - slot.0).collect();
        let (cost, cells) = paths.cheapest(self, region, &costs)?;
        let mut walk = Walk {
            cost,
            moves: cells.len() as f64,
            received: vec![0.0; self.data.len()],
            sent: vec![0.0; self.data.len()],
        };
        for cell in cells {
            for (received, rates) in walk.received.iter_mut().zip(&self.rates) {
                *received = received.max(rates[cell]);
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
