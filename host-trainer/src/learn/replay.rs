//! Replay memory: a ring of transitions without preferences, which are relabelled when a batch is drawn.

use crate::env::flight::Reward;
use gleaner_units::{Action, ActionMask};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// One slot of a flight, or several slots with n-step returns. `O` is what an encoding stores of a state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transition<O> {
    /// The state.
    pub before: O,
    /// The actions that the guard allowed there.
    pub mask_before: ActionMask,
    /// The action taken.
    pub action: Action,
    /// Percent of data, minus battery units; with n-step returns the discounted sum.
    pub reward: Reward,
    /// The next state; with n-step returns the state n slots later.
    pub after: O,
    /// The actions that the guard allows there.
    pub mask_after: ActionMask,
    /// Whether the mission ended before `after`.
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

    /// Adds a transition; a full memory drops its oldest.
    pub fn push(&mut self, transition: Transition<O>) {
        if self.ring.len() < self.capacity {
            self.ring.push(transition);
        } else {
            self.ring[self.next] = transition;
        }
        self.next = (self.next + 1) % self.capacity;
    }

    /// `count` transitions, uniformly and with replacement.
    ///
    /// # Panics
    /// When the memory is empty.
    pub fn sample(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<&Transition<O>> {
        (0..count).map(|_| &self.ring[rng.random_range(0..self.ring.len())]).collect()
    }

    /// Number of transitions.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.ring.len()
    }

    /// Whether there is no transition.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }
}
