//! The simulated world of training and of simulated flights: city, radio channel, devices, battery.
//!
//! # Glossary
//! - **city**: building heights per cell, and line of sight between open cells and flight altitude.
//! - **line of sight**: the straight line from a device on the ground to the aircraft passes over every
//!   building between them.
//! - **channel**: path loss, shadowing, noise, and the data of one slot at a given SNR.
//! - **world**: a city with a channel, and the mean SNR of every link.
//! - **device**: a sensor on open ground with data to collect.
//! - **data unit**: kappa x bits per second per hertz x one slot. A device starts with 5000 to 8000 of them.
//! - **scenario**: start, terminal, battery and number of devices. RD reaches a destination, RB returns to base.
//! - **realization**: a scenario with the devices drawn.
//! - **field**: the devices during a mission, with remaining data and SNR.
//! - **slot**: the time of one decision: one device sends, then the aircraft hovers or moves by one cell.
//! - **episode**: the flight of a realization.
//! - **seed**: determines every random draw. Training and evaluation seeds never give the same draws.
//!
//! # When you may trust it
//! - Equal seeds give equal worlds on every platform: the generator is ChaCha with 8 rounds, elementary functions are those
//!   of `libm`, line of sight uses integers, and sums run in index order.
//! - The order inside a slot is part of the contract, see [`Episode::step`].
//! - [`Episode::step`] does not check that an action is *safe*. It refuses only what is physically impossible: leaving the
//!   grid, and using more energy than the battery holds.
//! - The crate reads no file and no clock.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod channel;
mod city;
mod episode;
mod field;
mod generator;
mod link;
mod mirror;
mod realization;
mod scenario;
mod seed;
mod sight;

pub use channel::{Channel, Fading, PathLoss};
pub use city::{City, CityError};
pub use episode::{Episode, Step, StepError};
pub use field::{Device, Field, Serving};
pub use link::World;
pub use mirror::Mirror;
pub use realization::{Placement, Realization};
pub use scenario::{Scenario, ScenarioError, ScenarioKind};
pub use seed::{Seed, Stream};
