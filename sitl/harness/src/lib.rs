//! Simulated autopilot, radio and city around the *unchanged* pilot, and the program `gleaner-sitl`.
//!
//! Everything below the program runs on virtual time and in one process: a mission of ten minutes takes a
//! fraction of a second, and the same seed gives the same bytes.
//!
//! # Glossary
//! - **copter**: the simulated autopilot with its aircraft ([`Copter`]).
//! - **truth**: what is really so, which no wire carries ([`Truth`]).
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod autopilot;
mod wire;

pub use autopilot::{Copter, CopterMode, CopterSettings, LinkId, Pack, Truth};
