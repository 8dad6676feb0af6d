//! Decisions: how one is made and what is kept of it.

mod decider;
mod decision;
mod deliberator;
#[cfg(feature = "std")]
mod logged;
#[cfg(feature = "std")]
mod logged_lookahead;
#[cfg(feature = "std")]
mod replay;

pub(crate) use decider::{Decider, Standpoint};
pub use decision::{Decision, DecisionRecord, RECORD_BYTES_MAX};
pub use deliberator::{ChannelAware, Deliberator, LookAheadRecord, LookingAhead, Place};
#[cfg(feature = "std")]
pub use logged::{LoggedDecision, SimulatedSlot};
#[cfg(feature = "std")]
pub use logged_lookahead::{LoggedDevice, LoggedLookAhead, LoggedMission};
#[cfg(feature = "std")]
pub use replay::{LookAheadReplay, Replayed};
