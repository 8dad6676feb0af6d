//! A planner with full knowledge of map, channel and devices: the oracle that policies are measured against.
//!
//! A plan is a [`Tour`]: places to hover, for how long, and the way between them. Tours are judged by flying them in
//! the mean: each slot brings what the channel's expected rate says, from whichever device is heard best in the mean.
//! The best tour is searched by simulated annealing.

mod known;
mod search;
mod tour;

pub use known::{Audible, Known, Rates};
pub use search::{Effort, Problem};
pub use tour::{DEVICES_MAX, State, Stop, Tour};
