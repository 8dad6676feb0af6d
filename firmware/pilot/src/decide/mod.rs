//! Decisions: how one is made and what is kept of it.

pub(crate) mod decider;
mod decision;
#[cfg(feature = "std")]
mod logged;

pub use decision::{Decision, DecisionRecord, RECORD_BYTES_MAX};
#[cfg(feature = "std")]
pub use logged::{LoggedDecision, SimulatedSlot};
