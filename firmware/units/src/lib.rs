//! Quantities, frames and the geometry of the city grid.
//!
//! The bottom of the house: every other crate speaks in these words.
//!
//! # Glossary
//! - **cell**: one square of the city grid, named by `(x, y)`; x counts east, y counts north, `(0, 0)` is
//!   the south-west corner. A position "in" a cell means its centre.
//! - **grid frame**: metres east and north of the south-west *corner* of cell `(0, 0)`.
//! - **NED**: metres north, east and down of the origin of the autopilot's estimator, as MAVLink's
//!   `MAV_FRAME_LOCAL_NED` has it. That origin is *not* the take-off point.
//! - **action**: hover, or a move by one cell; the order 0..4 is part of the model's contract.
//! - **battery unit**: the energy of one move by one cell. Hovering for one slot takes half a unit.
//!
//! # What the types catch, and what they do not
//! A level ([`Dbm`]) cannot be added to a level, a ratio ([`Db`]) can be added to both. Positions in different
//! frames are different types. A [`Cell`] carries no proof that it lies inside a grid: [`Grid::contains`] and
//! [`Grid::index`] are the checks, and everything that indexes by cell goes through them.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod action;
mod cells;
#[cfg(feature = "std")]
pub mod city_file;
mod decimal;
mod frame;
mod grid;
mod heights;
mod quantity;
mod sight;
mod time;

pub use action::{Action, ActionMask};
pub use cells::CellSet;
pub use decimal::Decimal;
pub use frame::{GeoPoint, GridFrame, GridPoint, Ned};
pub use grid::{Cell, Grid, GridError, MAX_CELLS};
pub use heights::{CsvError, CsvFault, HeightMap};
pub use quantity::{BatteryUnits, Db, Dbm, Metres, MetresPerSecond};
pub use sight::{Rays, Sight};
pub use time::{Duration, Instant};
