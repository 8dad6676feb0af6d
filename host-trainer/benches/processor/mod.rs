//! CPU time.

/// CPU time of this thread, milliseconds. It advances with the scheduler ticks, so measured rounds must be long. Linux
/// only.
pub fn cpu_ms() -> Option<f64> {
    let line = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds * 1e-6)
}
