//! What runs only where there is no operating system, the same on every Cortex-M: time, faults, the log, the main
//! loop. Exists for targets without an operating system only.

mod fault;
mod flash;
mod fly;
mod log;
mod time;

pub use fault::end;
pub use fly::{Board, fly};
pub use log::LOG;
pub use time::{now, start_clock};
