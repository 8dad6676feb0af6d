//! The three serial lines of every board.
#![allow(unsafe_code)]

use crate::{Endpoint, Port, PortStats};

/// Speed of the line to the autopilot.
pub const LINK_BAUD: u32 = 921_600;
/// Speed of the line to the radio.
pub const RADIO_BAUD: u32 = 115_200;
/// Speed of the log.
pub const LOG_BAUD: u32 = 115_200;

/// In: 22 ms of a line that is never silent. Out: three frames.
type LinkPort = Port<2048, 512>;
/// In: 44 ms of a line that is never silent. The radio is not answered.
type RadioPort = Port<512, 1>;

/// To the autopilot.
pub static LINK: LinkPort = Port::new();
/// To the radio.
pub static RADIO: RadioPort = Port::new();
/// Of the log, which hears nothing.
pub static LOG: Port<1, 1024> = Port::new();

unsafe extern "Rust" {
    /// Makes the interrupt of the link's UART run soon. Each board defines it.
    safe fn gleaner_wake_link();
    /// The same for the log's UART.
    pub(super) safe fn gleaner_wake_log();
    /// Stops all transmitters. Each board defines it, with only register writes that cannot fail.
    pub(super) safe fn gleaner_silence();
}

/// The program's end of the link.
pub(super) fn link()
-> impl embedded_io::Read + embedded_io::ReadReady + embedded_io::Write + embedded_io::WriteReady {
    Endpoint::new(&LINK, || gleaner_wake_link())
}

/// The program's end of the radio's line.
pub(super) fn radio() -> impl embedded_io::Read + embedded_io::ReadReady {
    Endpoint::new(&RADIO, || ())
}

/// Counters of link and radio.
pub(super) fn losses() -> [PortStats; 2] {
    [LINK.stats(), RADIO.stats()]
}
