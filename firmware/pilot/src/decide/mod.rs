//! Decisions: how one is made and what is kept of it.

mod decider;
mod decision;
#[cfg(feature = "std")]
mod logged;

pub(crate) use decider::{Decider, Standpoint};
pub use decision::{Decision, DecisionRecord, RECORD_BYTES_MAX};
#[cfg(feature = "std")]
pub use logged::{LoggedDecision, SimulatedSlot};
