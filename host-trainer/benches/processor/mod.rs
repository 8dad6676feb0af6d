//! The processor's clock.

/// Milliseconds that this thread has been running, by the kernel's count; it moves on at each
/// scheduler tick, so rounds must be long. Only Linux tells.
pub fn cpu_ms() -> Option<f64> {
    let line = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds * 1e-6)
}
