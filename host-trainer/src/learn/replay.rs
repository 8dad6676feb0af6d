//! What was experienced: a ring of transitions without preferences, to be relabelled with any.

use crate::env::flight::Reward;
use gleaner_units::{Action, ActionMask};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// One slot of one flight; `O` is what an encoding keeps of a state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transition<O> {
    /// The state.
    pub before: O,
    /// What the guard allowed there.
    pub mask_before: ActionMask,
    /// What was done.
    pub action: Action,
    /// Percent of data, minus battery units.
    pub reward: Reward,
    /// The next state.
    pub after: O,
    /// What the guard allows there.
    pub mask_after: ActionMask,
    /// Whether the mission ended: `after` has no future.
    pub over: bool,
}

/// The last `capacity` transitions.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Replay<O> {
    capacity: usize,
    next: usize,
    ring: Vec<Transition<O>>,
}

impl<O> Replay<O> {
    /// An empty memory for up to `capacity` transitions.
    #[must_use]
    pub const fn new(capacity: usize) -> Replay<O> {
        Replay { capacity, next: 0, ring: Vec::new() }
    }

    /// Remembers a transition and forgets the oldest if there is no room.
    pub fn push(&mut self, transition: Transition<O>) {
        if self.ring.len() < self.capacity {
            self.ring.push(transition);
        } else {
            self.ring[self.next] = transition;
        }
        self.next = (self.next + 1) % self.capacity;
    }

    /// `count` transitions, uniformly and with repetition.
    pub fn sample(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<&Transition<O>> {
        (0..count).map(|_| &self.ring[rng.random_range(0..self.ring.len())]).collect()
    }

    /// How many are remembered.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.ring.len()
    }

    /// Whether nothing is remembered.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }
}
