//! The program's clock: monotonic, zero at its first use.

use gleaner_units::Instant;
use std::sync::LazyLock;
use std::time;

static START: LazyLock<time::Instant> = LazyLock::new(time::Instant::now);

/// The time now.
pub fn now() -> Instant {
    at(time::Instant::now())
}

/// The time of the program's clock when the system's monotonic clock shows `at`.
pub fn at(at: time::Instant) -> Instant {
    let since = at.saturating_duration_since(*START);
    Instant::from_micros(u64::try_from(since.as_micros()).unwrap_or(u64::MAX))
}
