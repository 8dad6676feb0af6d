//! How long the model takes, measured around it.

use core::cell::Cell;
use gleaner_policy::{Inference, Policy, Tokens};
use gleaner_units::{Duration, Instant};

/// An engine with a stop-watch. The answers are the engine's own: time is only measured, never used.
pub struct Timed<P> {
    engine: P,
    clock: fn() -> Instant,
    took: Cell<Option<Duration>>,
}

impl<P> Timed<P> {
    /// The engine, not yet timed, with the board's clock.
    pub const fn new(engine: P, clock: fn() -> Instant) -> Timed<P> {
        Timed { engine, clock, took: Cell::new(None) }
    }

    /// How long the last inference took, once.
    pub fn take(&self) -> Option<Duration> {
        self.took.take()
    }
}

impl<P: Policy> Policy for Timed<P> {
    type Error = P::Error;

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, P::Error> {
        let start = (self.clock)();
        let answer = self.engine.infer(tokens);
        self.took.set(Some((self.clock)().since(start)));
        answer
    }
}
