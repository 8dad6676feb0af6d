//! Look-ahead on board: tours flown in the on-board model, and the channel that the model assumes.
//!
//! The network proposes an action. The look-ahead flies whole tours in a deterministic model of the mission and proposes
//! the first action of the best one. The guard's mask limits both. The network decides alone when there is no map, when
//! the budget is zero, or when the model does not explain the SNR that the radio reports.
//!
//! # Glossary
//! - **model**: what a planner assumes about a mission: which device sends in a slot over a cell, how much the slot
//!   carries in the mean, and how many moves the way home takes. The trait [`Model`].
//! - **tour**: stops in order, each with a dwell, then the way home. [`Tour`].
//! - **mean flight**: a tour flown slot by slot in the model, without random draws. [`State`].
//! - **utility**: `w_data x percent of the data - w_energy x battery units`, from the present slot on.
//! - **kept plan**: the best tour of the slot before, less what has been flown of it.
//! - **channel fit**: the deviation of the real channel from the nominal one, estimated in flight from live SNR.
//! - **vantage point**: a cell from which a device is received fast.
//!
//! # Determinism
//! Effort is counted in tours, not in seconds, and all random draws come from one seeded generator. Equal inputs in equal
//! order give equal choices on every platform with IEEE 754 arithmetic, so a decision log can be replayed.
//!
//! # When you may trust this
//! - [`Choice::action`] is in the mask that was passed in, unless the mask is empty.
//! - The mean flight never violates the guard: every step leaves enough battery for the way home and the reserve.
//! - The expected data and energy are those of the model. They are as good as the map and the channel fit.
//! - There is no I/O, no clock, no heap and no panic.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod channel;
mod decide;
mod draw;
mod estimator;
mod fit;
mod links;
mod model;
mod rates;
mod search;
mod tour;
mod what_if;

pub use channel::{ChannelModel, PathLoss};
pub use decide::{Budget, Choice, Expected, LookAhead, Source, View, W_DATA_MAX};
pub use estimator::ChannelEstimator;
pub use fit::{ChannelEstimate, ChannelFit, FitSettings};
pub use links::Links;
pub use model::{EMPTY_UNITS, Model, Onboard, Transmission};
pub use rates::Rates;
pub use search::{Effort, Problem};
pub use tour::{STOPS_MAX, State, Stop, Tour};
pub use what_if::{Outlook, Waypoint};
