//! What runs only where there is no operating system, the same on every Cortex-M: time, faults, the log, the main
//! loop. Exists for targets without an operating system only.

mod fault;
mod flash;
mod fly;
mod lines;
mod log;
mod time;

pub use fault::end;
pub use flash::{Refused, parameter_bytes, parameter_place};
pub use fly::{Board, fly};
pub use lines::{LINK, LINK_BAUD, LOG, LOG_BAUD, RADIO, RADIO_BAUD};
pub use time::{now, start_clock};
