//! The time that a policy takes, measured around it.

use crate::{Inference, Policy, Tokens};
use core::cell::Cell;
use gleaner_units::{Duration, Instant};

/// A policy with a stopwatch. The time is measured and reported, never used: the answers are the policy's own.
pub struct Timed<P> {
    policy: P,
    clock: fn() -> Instant,
    took: Cell<Option<Duration>>,
}

impl<P> Timed<P> {
    /// Wraps `policy`. `clock` returns the time now.
    pub const fn new(policy: P, clock: fn() -> Instant) -> Timed<P> {
        Timed { policy, clock, took: Cell::new(None) }
    }

    /// How long the last inference took. `None` after it was taken, or when there was no inference yet.
    pub fn take(&self) -> Option<Duration> {
        self.took.take()
    }
}

impl<P: Policy> Policy for Timed<P> {
    type Error = P::Error;

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, P::Error> {
        let start = (self.clock)();
        let answer = self.policy.infer(tokens);
        self.took.set(Some((self.clock)().since(start)));
        answer
    }
}
