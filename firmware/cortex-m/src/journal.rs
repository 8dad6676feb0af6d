//! What a board logs, without saying how.

use crate::PortStats;
use gleaner_pilot::{Decision, State};
use gleaner_units::Duration;

/// Takes note. An implementation must not wait.
pub trait Journal {
    /// The pilot changed its state.
    fn state(&mut self, from: State, to: State);
    /// A decision was made; how long the model took, where it was asked.
    fn decision(&mut self, decision: &Decision, took: Option<Duration>);
    /// Bytes were lost or damaged on a port; the counters as they are now.
    fn losses(&mut self, port: &'static str, stats: PortStats);
}
