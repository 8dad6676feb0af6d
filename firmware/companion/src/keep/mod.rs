//! What outlives a run, in the state folder: parameters set from the ground, and how the last run ended.

mod atomic;
mod last_run;
mod parameters;

pub use atomic::Replacer;
pub use last_run::{LastRun, LastRunFile};
pub use parameters::ParameterFile;
