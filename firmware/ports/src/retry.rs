//! Back-off between attempts to open a lost port.

use std::time::{Duration, Instant};

/// Wait before the first attempt to open a lost port again.
pub const RETRY_FIRST: Duration = Duration::from_millis(250);
/// Longest wait: each failure doubles it up to here.
pub const RETRY_LONGEST: Duration = Duration::from_secs(4);

/// Waits that double with each attempt.
#[derive(Debug)]
pub(crate) struct Retry {
    delay: Duration,
    due: Option<Instant>,
}

impl Retry {
    pub(crate) fn new() -> Retry {
        Retry { delay: RETRY_FIRST, due: None }
    }

    /// Whether an attempt is due. The first call after a success or [`Retry::reset`] starts the wait.
    pub(crate) fn is_due(&mut self, now: Instant) -> bool {
        let due = *self.due.get_or_insert(now + self.delay);
        if now < due {
            return false;
        }
        self.delay = (self.delay * 2).min(RETRY_LONGEST);
        self.due = Some(now + self.delay);
        true
    }

    pub(crate) fn reset(&mut self) {
        *self = Retry::new();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_the_longest() {
        let start = Instant::now();
        let mut retry = Retry::new();
        let mut attempts_ms = Vec::new();
        for ms in 0..20_000 {
            if retry.is_due(start + Duration::from_millis(ms)) {
                attempts_ms.push(ms);
            }
        }
        assert_eq!(attempts_ms, [250, 750, 1750, 3750, 7750, 11_750, 15_750, 19_750]);
        retry.reset();
        let later = start + Duration::from_secs(30);
        assert!(!retry.is_due(later));
        assert!(retry.is_due(later + RETRY_FIRST));
    }
}
