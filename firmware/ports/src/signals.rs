//! The signals that ask a program to end.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A flag that becomes true when the operating system asks this program to end: by SIGINT, SIGTERM, or SIGHUP, which
/// is sent when the terminal is closed.
///
/// A signal that was ignored when the program started stays ignored: hangups under `nohup`, interrupts of a
/// background job in a script.
///
/// # Errors
/// The system refuses a handler.
pub fn end_requested() -> io::Result<Arc<AtomicBool>> {
    let requested = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if !is_ignored(signal) {
            flag::register(signal, Arc::clone(&requested))?;
        }
    }
    Ok(requested)
}

/// From `/proc/self/status` (proc(5)): a hexadecimal mask with the lowest bit for signal 1. Without that file no
/// signal counts as ignored.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
