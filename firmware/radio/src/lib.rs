//! Live SNR reports without I/O: bytes to reports, and the table of devices.
//!
//! # What it owns
//! The formats of radio reports, and the last report of each device on the ground. Which device is served, and what its
//! SNR means, is decided elsewhere.
//!
//! # Glossary
//! - **device**: one sensor on the ground, named by a 32-bit id that the mission lists; for LoRaWAN its DevAddr.
//! - **report**: one measurement of one device ([`Report`]).
//! - **format**: the bytes in which a radio reports ([`Format`]).
//! - **age**: time from the measurement to the arrival of its report, plus the time since.
//! - **remaining**: data units that the device still holds, if its report says.
//!
//! # Wire format
//! One report is one frame between zero bytes: `00 COBS(body crc) 00`. The zero byte in front ends any noise before the
//! frame. Empty frames are ignored.
//!
//! | part | content |
//! |---|---|
//! | `body` | postcard: device (varint u32), SNR in dB (f32, little endian), remaining (0, or 1 and an f32), age in ms (varint u32) |
//! | `crc` | CRC-16/IBM-SDLC of the body, low byte first (check value of "123456789": 0x906E) |
//!
//! Device 300 at 2.5 dB with 1000 units remaining, measured 250 ms ago:
//!
//! ```
//! use gleaner_radio::{Report, ReportDecoder, encode};
//! use gleaner_units::Db;
//!
//! let report = Report { device: 300, snr: Db(2.5), remaining: Some(1000.0), age_ms: 250 };
//! let frame = [
//!     0x00, // delimiter
//!     0x03, 0xAC, 0x02, // COBS: the next zero is 3 on. Device 300
//!     0x01, 0x04, 0x20, 0x40, 0x01, // two zeros, 20 40: SNR 2.5. 01: remaining follows
//!     0x01, 0x07, 0x7A, 0x44, // two zeros, 7A 44: 1000.0
//!     0xFA, 0x01, // age 250
//!     0x9E, 0xFB, // checksum 0xFB9E
//!     0x00, // delimiter
//! ];
//! assert_eq!(encode(&report), frame);
//! let mut decoder = ReportDecoder::new();
//! decoder.push(&frame, |decoded| assert_eq!(decoded, report));
//! assert_eq!(decoder.stats().reports, 1);
//! ```
//!
//! Inside a MAVLink `TUNNEL` the body stands alone: the MAVLink frame has its own checksum
//! ([`decode_body`]).
//!
//! # When you may trust what
//! A decoded [`Report`] has a correct checksum, and any numbers. [`DeviceTable`] checks them, once for all formats: what it
//! holds is finite, no remaining amount exceeds the mission's figure, and none falls faster than slots can carry data.
//! Reports of unknown devices are counted and ignored.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

#[cfg(any(test, feature = "host"))]
extern crate std;

/// Fixed seed for property tests.
#[cfg(test)]
fn seeded() -> proptest::test_runner::Config {
    use proptest::test_runner::{Config, RngSeed};
    Config { rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..Config::default() }
}

mod format;
mod reception;
mod report;
mod table;

pub use format::{Calibration, Format, ReportDecoder, ReportStats, required_snr};
#[cfg(feature = "host")]
pub use format::{JsonLines, SemtechUdp};
pub use reception::{Likely, Reception, Remark};
pub use report::{BODY_BYTES, FrameBytes, Report, ReportFault, decode_body, encode, encode_body};
pub use table::{Applied, DeviceTable, TableError, TableStats};
