//! The program's clock: monotonic, from zero at the start.

use gleaner_units::Instant;

/// Where the pilot's time comes from.
#[derive(Clone, Copy)]
pub struct Clock {
    start: std::time::Instant,
}

impl Clock {
    /// A clock that shows zero now.
    pub fn start() -> Clock {
        Clock { start: std::time::Instant::now() }
    }

    /// What the clock shows when the system shows `at`.
    pub fn at(&self, at: std::time::Instant) -> Instant {
        let since = at.saturating_duration_since(self.start);
        Instant::from_micros(u64::try_from(since.as_micros()).unwrap_or(u64::MAX))
    }
}
