//! What every board of ours has in common: everything but pins, clocks and registers.
//!
//! A board is a small program (`src/bin/f405`, `src/bin/h743`) that brings up its clocks and its serial ports,
//! lends them to [`Runtime`], and calls [`Runtime::pass`] for ever. Anything that could be tested on a host is in
//! this library and is tested on a host.
//!
//! # Glossary
//! - **port**: one serial line with a ring of bytes in each direction ([`Port`]). Interrupts move bytes between
//!   ring and wire; the program only ever touches rings, so it never waits for a wire.
//! - **pass**: one turn of the main loop, with a bounded amount of work ([`Runtime::pass`]).
//! - **decision loop**: the polls of the pilot, every 20 ms. Only they feed the watchdog.
//! - **store**: the parameters in flash, through every loss of power ([`ParameterStore`]).
//! - **last words**: why the program before this one ended, kept in RAM over the reset ([`LastWords`]).
//! - **journal**: what a board logs; on a board, defmt frames on the third serial port ([`Journal`]).
//!
//! # When you may trust this
//! Nothing here waits, allocates or panics; a release image in which a panic could be reached does not link.
//! A stop of the decision loop for a second, a fault and a panic all end in a reset, after which the aircraft is
//! not steered until the operator asks again.
#![no_std]
#![warn(missing_docs)]
#![deny(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

#[cfg(test)]
extern crate std;

#[cfg(target_os = "none")]
pub mod bare;
mod journal;
mod keeper;
mod last_words;
mod port;
mod ring;
mod runtime;
mod store;

pub use journal::Journal;
pub use keeper::{Keeper, News};
pub use last_words::{Cause, LastWords, Obituary, ResetFlags};
pub use port::{Endpoint, LineFault, Port, PortStats, Uart};
pub use ring::Ring;
pub use runtime::Runtime;
pub use store::{Found, ParameterStore, SaveError};
