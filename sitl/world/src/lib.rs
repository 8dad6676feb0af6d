//! The city, its radio channel, its devices and the battery: the world that the policy is trained in and
//! that the simulated flights take place in.
//!
//! # Glossary
//! - **city**: building heights per cell, and which open cell sees which point at flight altitude.
//! - **line of sight**: the straight line from a device on the ground to the aircraft passes over every
//!   building between them.
//! - **channel**: path loss, shadowing, noise, and what one data slot carries at a given SNR.
//! - **world**: a city with a channel, and the mean SNR of every link.
//! - **device**: a sensor on open ground that holds some data.
//! - **data unit**: kappa x bits per second per hertz x one slot. A device starts with 5000 to 8000 of them.
//! - **scenario**: start, terminal, battery and number of devices. RD reaches a destination, RB returns to base.
//! - **realization**: a scenario with the devices drawn.
//! - **field**: the devices during a mission: what each still holds and how strongly it is heard.
//! - **slot**: one decision: one device is served, then the aircraft hovers or moves by one cell.
//! - **episode**: a realization being flown.
//! - **seed**: names every random draw. Training and evaluation seeds never give the same draws.
//!
//! # When you may trust it
//! - Equal seeds give equal worlds on every platform: the generator is named (ChaCha with 8 rounds), logarithms and
//!   the like come from `libm`, line of sight is decided in whole numbers, and sums run in index order.
//! - The order inside a slot is part of the contract, see [`Episode::step`].
//! - Which actions are *safe* is not decided here. [`Episode::step`] refuses only what is physically
//!   impossible: leaving the grid, spending energy that is not there.
//! - Nothing here reads a file or a clock. Text comes in, values go out.
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
