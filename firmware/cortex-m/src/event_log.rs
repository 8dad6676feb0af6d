//! What a board logs, independent of how it is written.

use crate::PortStats;
use gleaner_pilot::{Decision, State};
use gleaner_units::Duration;

/// Receives events. An implementation must not block.
pub trait EventLog {
    /// The pilot changed state.
    fn state(&mut self, from: State, to: State);
    /// The pilot made a decision; `took` is the inference time when the network was evaluated.
    fn decision(&mut self, decision: &Decision, took: Option<Duration>);
    /// A port lost bytes or received damaged ones; `stats` are its counters now.
    fn losses(&mut self, port: &'static str, stats: PortStats);
}
