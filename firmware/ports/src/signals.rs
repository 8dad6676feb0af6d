//! The signals that ask a program to end.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A flag that is raised when the operating system asks this program to end: SIGINT, SIGTERM, or SIGHUP, which comes
/// when the terminal is closed.
///
/// What was ignored when the program was started stays ignored: hangups under `nohup`, interrupts of a script's
/// background.
///
/// # Errors
/// The system refuses a handler.
pub fn asked_to_end() -> io::Result<Arc<AtomicBool>> {
    let asked = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if !is_ignored(signal) {
            flag::register(signal, Arc::clone(&asked))?;
        }
    }
    Ok(asked)
}

/// From `/proc/self/status` (proc(5)): a mask in hexadecimal, the lowest bit for signal 1. Without it nothing is taken
/// for ignored.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
