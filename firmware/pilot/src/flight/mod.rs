//! The parts of a flight: the plan fixed at engage, the leg under way, the energy, the pace of targets, the watches.

pub(crate) mod burn;
pub(crate) mod energy;
pub(crate) mod leg;
pub(crate) mod plan;
pub(crate) mod stream;
pub(crate) mod watch;
