//! Nodes of the branch-and-bound tree.

use super::Mission;
use super::multipliers::Multipliers;
use std::cmp::Ordering;

/// Below this rate, data units per slot, a device counts as not received when nodes are split.
const RATE_MIN: f64 = 20.0;
/// If the walk receives a device below this share of the node's maximum, the interval is split at [`SPLIT_SHARE`] of the
/// maximum; otherwise at the geometric mean of the two rates.
const SLOW_SHARE: f64 = 0.4;
/// See [`SLOW_SHARE`].
const SPLIT_SHARE: f64 = 0.45;

/// A set of missions: those whose fastest rate of each device lies in an interval.
#[derive(Clone)]
pub(super) struct Node {
    /// By device: the fastest rate is above this; 0 for no constraint.
    pub above: Vec<f64>,
    /// By device: the fastest rate is at most this.
    pub at_most: Vec<f64>,
    /// By device: the fastest rate over the allowed cells.
    pub fastest: Vec<f64>,
    /// The best multipliers found, from which the children start.
    pub multipliers: Multipliers,
    /// Upper bound on the data of these missions, data units.
    pub bound: f64,
    /// By device: the fastest rate on the walk that gave the bound.
    pub received: Vec<f64>,
}

/// Where to split a node: a device and a rate.
pub(super) struct Branch {
    device: usize,
    rate: f64,
}

impl Node {
    /// All missions.
    pub fn root(mission: &Mission) -> Node {
        let devices = mission.data.len();
        Node {
            above: vec![0.0; devices],
            at_most: vec![f64::INFINITY; devices],
            fastest: Vec::new(),
            multipliers: Multipliers::initial(devices),
            bound: mission.data.iter().sum(),
            received: Vec::new(),
        }
    }

    /// The device whose relaxation is loosest, and a rate between what the walk receives and the node's maximum. `None`
    /// if the walk receives every device at the maximum: splitting would not lower the bound.
    ///
    /// The looseness of a device is the number of slots that its data takes at the walk's rate, less that at the maximum.
    pub fn branching(&self, mission: &Mission) -> Option<Branch> {
        let slow = |device: usize| self.received[device].max(self.above[device]);
        let looseness = |device: usize| {
            let [slow, fast] = [slow(device).max(RATE_MIN), self.fastest[device]];
            if slow < fast { mission.data[device] * (1.0 / slow - 1.0 / fast) } else { 0.0 }
        };
        let device = (0..mission.data.len()).max_by(|&a, &b| looseness(a).total_cmp(&looseness(b)))?;
        let [slow, fast] = [slow(device), self.fastest[device]];
        let rate = if slow < SLOW_SHARE * fast { SPLIT_SHARE * fast } else { (slow * fast).sqrt() };
        (looseness(device) > 0.0).then_some(Branch { device, rate })
    }

    /// The missions that receive the device at most at the branch's rate, and those that receive it faster.
    pub fn split(self, Branch { device, rate }: Branch) -> [Node; 2] {
        let (mut slower, mut faster) = (self.clone(), self);
        slower.at_most[device] = rate;
        faster.above[device] = rate;
        [slower, faster]
    }
}

/// Nodes are ordered by their bounds.
impl Ord for Node {
    fn cmp(&self, other: &Node) -> Ordering {
        self.bound.total_cmp(&other.bound)
    }
}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Node) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Node) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Node {}
