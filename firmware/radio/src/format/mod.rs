//! Formats in which a radio reports. All of them end in [`Report`]s.
//!
//! | format | transport | answers |
//! |---|---|---|
//! | [`ReportDecoder`] | postcard in COBS, the format of our own modems: see the crate's page | - |
//! | `JsonLines` (feature `host`) | one JSON object per line or datagram | - |
//! | `SemtechUdp` (feature `host`) | LoRaWAN packet forwarder, Semtech UDP protocol version 1 and 2 | PUSH_ACK, PULL_ACK |

mod calibration;
mod cobs;
#[cfg(feature = "host")]
mod json_lines;
#[cfg(feature = "host")]
mod semtech_udp;

pub use calibration::{Calibration, required_snr};
pub use cobs::{ReportDecoder, ReportStats};
#[cfg(feature = "host")]
pub use json_lines::JsonLines;
#[cfg(feature = "host")]
pub use semtech_udp::SemtechUdp;

use crate::Report;

/// Bytes of a radio to reports.
pub trait Format {
    /// Takes in the bytes of one read or one datagram. Calls `report` for every report, and `reply` for every answer,
    /// which goes back to the sender of these bytes.
    fn receive(&mut self, bytes: &[u8], report: &mut dyn FnMut(Report), reply: &mut dyn FnMut(&[u8]));

    /// The counters.
    fn stats(&self) -> ReportStats;
}
