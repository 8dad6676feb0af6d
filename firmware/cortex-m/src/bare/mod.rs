//! The part that runs without an operating system only: time, faults, the log, the main loop.

mod defmt_log;
mod fault;
mod fly;
mod images;
mod parameter_place;
mod serial;
pub mod stm32;
mod time;

pub use fault::end;
pub use fly::fly;
pub use parameter_place::{parameter_bytes, parameter_place};
pub use serial::{LINK, LINK_BAUD, LOG, LOG_BAUD, RADIO, RADIO_BAUD};
pub use time::{SysTickDelay, now, start_clock};
