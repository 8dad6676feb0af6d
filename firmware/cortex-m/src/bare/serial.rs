//! The three serial lines of every board.
#![allow(unsafe_code)]

use crate::{Endpoint, Port, PortStats};

/// Baud rate of the line to the autopilot.
pub const LINK_BAUD: u32 = 921_600;
/// Baud rate of the line to the radio.
pub const RADIO_BAUD: u32 = 115_200;
/// Baud rate of the log.
pub const LOG_BAUD: u32 = 115_200;

/// Receive: 22 ms of a saturated line. Transmit: three frames.
type LinkPort = Port<2048, 512>;
/// Receive: 44 ms of a saturated line. Nothing is sent to the radio.
type RadioPort = Port<512, 1>;

/// The port to the autopilot.
pub static LINK: LinkPort = Port::new();
/// The port to the radio.
pub static RADIO: RadioPort = Port::new();
/// The port of the log, which receives nothing.
pub static LOG: Port<1, 1024> = Port::new();

unsafe extern "Rust" {
    /// Sets the interrupt of the link's UART pending. Each board defines it.
    safe fn gleaner_wake_link();
    /// The same for the log's UART.
    pub(super) safe fn gleaner_wake_log();
    /// Stops all transmitters. Each board defines it with register writes only, so that it cannot fail.
    pub(super) safe fn gleaner_stop_transmitters();
}

/// The program's end of the link.
pub(super) fn link()
-> impl embedded_io::Read + embedded_io::ReadReady + embedded_io::Write + embedded_io::WriteReady {
    Endpoint::new(&LINK, || gleaner_wake_link())
}

/// The program's end of the radio port.
pub(super) fn radio() -> impl embedded_io::Read + embedded_io::ReadReady {
    Endpoint::new(&RADIO, || ())
}

/// Counters of the link port and of the radio port.
pub(super) fn losses() -> [PortStats; 2] {
    [LINK.stats(), RADIO.stats()]
}
