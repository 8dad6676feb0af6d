//! Time as an argument. Only programs read a clock.

use core::ops::{Add, Sub};
use serde::{Deserialize, Serialize};

/// A point in time: microseconds since the start of the caller's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Instant {
    micros: u64,
}

impl Instant {
    /// The start of the clock.
    pub const ZERO: Instant = Instant { micros: 0 };

    /// `micros` microseconds after the start.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Instant {
        Instant { micros }
    }

    /// `millis` milliseconds after the start.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Instant {
        Instant { micros: millis.saturating_mul(1_000) }
    }

    /// Microseconds since the start.
    #[must_use]
    pub const fn as_micros(self) -> u64 {
        self.micros
    }

    /// Whole milliseconds since the start.
    #[must_use]
    pub const fn as_millis(self) -> u64 {
        self.micros / 1_000
    }

    /// MAVLink's `time_boot_ms`: milliseconds since the start, wrapping after 49.7 days.
    #[must_use]
    pub const fn as_boot_ms(self) -> u32 {
        (self.micros / 1_000) as u32
    }

    /// The time since `earlier`; zero if `earlier` is later.
    #[must_use]
    pub const fn since(self, earlier: Instant) -> Duration {
        Duration { micros: self.micros.saturating_sub(earlier.micros) }
    }
}

impl Add<Duration> for Instant {
    type Output = Instant;
    fn add(self, duration: Duration) -> Instant {
        Instant { micros: self.micros.saturating_add(duration.micros) }
    }
}

impl Sub for Instant {
    type Output = Duration;
    fn sub(self, earlier: Instant) -> Duration {
        self.since(earlier)
    }
}

/// A time span, never negative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Duration {
    micros: u64,
}

impl Duration {
    /// No time.
    pub const ZERO: Duration = Duration { micros: 0 };

    /// `micros` microseconds.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Duration {
        Duration { micros }
    }

    /// `millis` milliseconds.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Duration {
        Duration { micros: millis.saturating_mul(1_000) }
    }

    /// `secs` seconds.
    #[must_use]
    pub const fn from_secs(secs: u64) -> Duration {
        Duration { micros: secs.saturating_mul(1_000_000) }
    }

    /// `secs` seconds. Negative and NaN give zero; too large a number gives the longest span.
    #[must_use]
    pub fn from_secs_f32(secs: f32) -> Duration {
        Duration { micros: (f64::from(secs) * 1e6) as u64 }
    }

    /// In microseconds.
    #[must_use]
    pub const fn as_micros(self) -> u64 {
        self.micros
    }

    /// In whole milliseconds.
    #[must_use]
    pub const fn as_millis(self) -> u64 {
        self.micros / 1_000
    }

    /// In seconds.
    #[must_use]
    pub fn as_secs_f32(self) -> f32 {
        (self.micros as f64 * 1e-6) as f32
    }
}

impl Add for Duration {
    type Output = Duration;
    fn add(self, other: Duration) -> Duration {
        Duration { micros: self.micros.saturating_add(other.micros) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_saturates() {
        let early = Instant::from_millis(5);
        let late = early + Duration::from_secs(2);
        assert_eq!(late - early, Duration::from_millis(2_000));
        assert_eq!(early - late, Duration::ZERO);
        assert_eq!(Instant::from_micros(u64::MAX) + Duration::from_secs(1), Instant::from_micros(u64::MAX));
        assert_eq!(Duration::from_secs_f32(f32::NAN), Duration::ZERO);
        assert_eq!(Duration::from_secs_f32(-1.0), Duration::ZERO);
        assert_eq!(Duration::from_secs_f32(0.25), Duration::from_millis(250));
        assert_eq!(Instant::from_millis(0x1_0000_0005).as_boot_ms(), 5);
    }
}
