//! The engage-inhibit input: a switch or a remove-before-flight jumper that blocks engaging.

use embedded_hal::digital::{InputPin, PinState};
use gleaner_units::{Duration, Instant};

/// How long the line must read "permitted" without interruption before engaging is permitted.
const SETTLE: Duration = Duration::from_millis(100);

/// A debounced input that fails safe: it reports "inhibited" at start, on the first reading of the inhibiting level,
/// and when the pin cannot be read. It reports "permitted" only after 100 ms of unbroken permitting level.
///
/// A board wires it with a pull-up and permits at the low level, so that a broken wire inhibits.
pub struct EngageInhibit<P> {
    pin: P,
    permits: PinState,
    permitted_since: Option<Instant>,
}

impl<P: InputPin> EngageInhibit<P> {
    /// An inhibited input on `pin`; `permits` is the level that permits engaging.
    pub const fn new(pin: P, permits: PinState) -> EngageInhibit<P> {
        EngageInhibit { pin, permits, permitted_since: None }
    }

    /// Reads the pin once; returns whether engaging is inhibited. Call it in every iteration of the decision loop.
    pub fn poll(&mut self, now: Instant) -> bool {
        let level = self.pin.is_high().map(PinState::from);
        if level.ok() != Some(self.permits) {
            self.permitted_since = None;
            return true;
        }
        let since = *self.permitted_since.get_or_insert(now);
        now.since(since) < SETTLE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doubles::Input;

    fn at(millis: u64) -> Instant {
        Instant::from_millis(millis)
    }

    #[test]
    fn permission_needs_100_ms_without_interruption() {
        let line = Input::new(Some(PinState::Low));
        let mut inhibit = EngageInhibit::new(line.clone(), PinState::Low);
        assert!(inhibit.poll(at(1000)) && inhibit.poll(at(1080)));
        line.set(Some(PinState::High));
        assert!(inhibit.poll(at(1090)), "a bounce starts the count again");
        line.set(Some(PinState::Low));
        assert!(inhibit.poll(at(1100)) && inhibit.poll(at(1199)));
        assert!(!inhibit.poll(at(1200)));
    }

    #[test]
    fn one_reading_of_the_other_level_inhibits() {
        for permits in [PinState::Low, PinState::High] {
            let line = Input::new(Some(permits));
            let mut inhibit = EngageInhibit::new(line.clone(), permits);
            inhibit.poll(at(0));
            assert!(!inhibit.poll(at(100)));
            line.set(Some(!permits));
            assert!(inhibit.poll(at(120)), "{permits:?}");
        }
    }

    #[test]
    fn a_pin_that_cannot_be_read_inhibits() {
        let line = Input::new(Some(PinState::Low));
        let mut inhibit = EngageInhibit::new(line.clone(), PinState::Low);
        inhibit.poll(at(0));
        assert!(!inhibit.poll(at(200)));
        line.set(None);
        assert!(inhibit.poll(at(220)) && inhibit.poll(at(900)));
    }
}
