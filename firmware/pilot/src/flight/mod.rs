//! The parts of a flight: the plan fixed at engage, the course and its legs, the moving target and its pace, the energy,
//! the watches.

pub(crate) mod burn;
pub(crate) mod charge;
pub(crate) mod course;
pub(crate) mod energy;
pub(crate) mod leg;
pub(crate) mod plan;
pub(crate) mod prices;
pub(crate) mod speed;
pub(crate) mod stream;
pub(crate) mod track;
pub(crate) mod watch;
