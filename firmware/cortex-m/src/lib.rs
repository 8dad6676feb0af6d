//! The part of the board program that is the same on every board: everything but pins, clocks and registers.
//!
//! A board is a small program (`src/bin/f405`, `src/bin/h743`) that implements [`Board`]: it brings up clocks, pins and
//! UARTs and hands them over. The main loop then calls [`Runtime::pass`] forever. Logic that can run on a
//! host is in this library and is tested on a host, against doubles that are stricter than the hardware.
//!
//! # Glossary
//! - **port**: one serial line with a byte ring in each direction ([`Port`]). Interrupts move bytes between ring and
//!   UART; the program reads and writes rings only, so it never blocks on a line.
//! - **pass**: one iteration of the main loop, with a bounded amount of work ([`Runtime::pass`]).
//! - **decision loop**: the polls of the pilot, every 20 ms. Only they feed the watchdog.
//! - **panel**: the status LED and the engage-inhibit input ([`Panel`]).
//! - **parameter store**: the parameters in flash, safe against power loss at any moment ([`ParameterStore`]).
//! - **reset record**: why the previous program ended, kept in RAM across a reset ([`ResetRecord`]).
//! - **event log**: what a board logs; on hardware, defmt frames on the third serial port ([`EventLog`]).
//!
//! # Guarantees
//! Nothing here blocks, allocates or panics; a release image that can reach a panic does not link. A decision loop
//! that stops for a second, a fault and a panic all end in a reset. After a reset the program does not command the
//! aircraft until the operator asks again.
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
mod board;
#[cfg(test)]
mod doubles;
mod event_log;
mod inhibit;
mod panel;
mod parameter_flash;
mod parameter_saver;
mod port;
mod reset_record;
mod ring;
mod runtime;
mod status_led;
mod store;

pub use board::{Board, Parts, Services};
pub use event_log::EventLog;
pub use inhibit::EngageInhibit;
pub use panel::Panel;
pub use parameter_flash::{FlashController, FlashError, ParameterFlash};
pub use parameter_saver::{ParameterSaver, SaveNotice};
pub use port::{Endpoint, LineFault, Port, PortStats, Uart};
pub use reset_record::{Cause, ResetFlags, ResetRecord, ResetReport};
pub use ring::Ring;
pub use runtime::{Pilot, Runtime};
pub use status_led::{Signal, StatusLed};
pub use store::{ParameterStore, Restored, SaveError};
