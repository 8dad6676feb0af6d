//! Decisions: how one is made and what is kept of it.

pub(crate) mod decider;
mod decision;

pub use decision::{Decision, DecisionRecord, RECORD_BYTES_MAX};
