//! Quantities, frames and the geometry of the city grid.
//!
//! The lowest crate: all others use its types.
//!
//! # Glossary
//! - **cell**: one square of the city grid, `(x, y)`. x counts along the grid's east axis, y along its north axis, and
//!   `(0, 0)` is the south-west corner. A position "in" a cell is its centre.
//! - **grid frame**: metres from the south-west *corner* of cell `(0, 0)` along the grid's axes.
//! - **rotation**: direction of the grid's north axis, clockwise from true north. 0 unless the mission sets it, for
//!   example to align cells with streets. Actions are relative to the grid: `north` moves along its north axis.
//! - **NED**: metres north, east and down of the origin of the autopilot's estimator (`MAV_FRAME_LOCAL_NED`). This origin
//!   is *not* the take-off point.
//! - **action**: hover, or a move by one cell. The order 0..4 is part of the model's contract.
//! - **battery unit**: the energy of one move by one cell. Hovering for one slot costs half a unit.
//!
//! # What the types prevent, and what they do not
//! Two levels ([`Dbm`]) cannot be added; a ratio ([`Db`]) can be added to a level or to a ratio. Positions in different
//! frames have different types, and [`GridFrame`] converts between them with an isometry. A [`Cell`] may be outside a
//! grid: [`Grid::contains`] and [`Grid::index`] check it, and every table of cells is indexed through them.
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
pub use frame::{GeoPoint, GridFrame, GridPoint, GridPose, Ned};
pub use grid::{BOARD_CELLS, Cell, Grid, GridError, MAX_CELLS};
pub use heights::{CsvError, CsvFault, HeightMap};
pub use quantity::{BatteryUnits, Db, Dbm, Degrees, Metres, MetresPerSecond};
pub use sight::{Rays, Sight};
pub use time::{Duration, Instant};
