//! How long the model takes, measured around it.

use gleaner_policy::{Inference, Policy, Tokens};
use std::cell::Cell;
use std::time::{Duration, Instant};

/// An engine with a stop-watch. The answers are the engine's own: time is only measured, never used.
pub struct Timed<P> {
    engine: P,
    took: Cell<Option<Duration>>,
}

impl<P> Timed<P> {
    /// The engine, not yet timed.
    pub fn new(engine: P) -> Timed<P> {
        Timed { engine, took: Cell::new(None) }
    }

    /// How long the last inference took, once.
    pub fn take(&self) -> Option<Duration> {
        self.took.take()
    }
}

impl<P: Policy> Policy for Timed<P> {
    type Error = P::Error;

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, P::Error> {
        let start = Instant::now();
        let answer = self.engine.infer(tokens);
        self.took.set(Some(start.elapsed()));
        answer
    }
}
