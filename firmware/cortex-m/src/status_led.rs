//! The status LED: one blink pattern for each state that an operator beside the aircraft must distinguish.

use embedded_hal::digital::{OutputPin, PinState};
use gleaner_pilot::State;
use gleaner_units::Instant;

/// What the LED shows. Every pattern but [`Signal::Boot`] changes at least once in two seconds: an LED that stays on
/// or off belongs to a board without power or to a program that has stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Lit: self-test running.
    Boot,
    /// One short flash in 2 s: nothing requested.
    Idle,
    /// One long flash (0.5 s) in 2 s: shadow mode, decides and logs only.
    Shadow,
    /// On and off for 0.5 s each: engage requested, a condition is missing.
    Waiting,
    /// Lit, with a short gap each second: Gleaner commands the aircraft.
    Commanding,
    /// Two short flashes in 2 s: the mission is done, or the pilot has taken over.
    Released,
    /// Three short flashes in 2 s: the inhibit input blocks engaging.
    Inhibited,
    /// Five flashes a second: fault.
    Fault,
}

impl Signal {
    /// The pattern for a state of the pilot. The inhibit input shows only while it matters: not in flight, not over a
    /// fault.
    #[must_use]
    pub const fn of(state: State, inhibited: bool) -> Signal {
        match state {
            State::Boot => Signal::Boot,
            State::Engaged | State::Homing => Signal::Commanding,
            State::Fault => Signal::Fault,
            _ if inhibited => Signal::Inhibited,
            State::Idle => Signal::Idle,
            State::Waiting => Signal::Waiting,
            State::Done | State::Passive => Signal::Released,
            State::Shadow => Signal::Shadow,
        }
    }

    /// Whether the LED is lit at this time.
    #[must_use]
    pub fn is_lit(self, now: Instant) -> bool {
        let millis = now.as_micros() / 1000;
        let in_two_seconds = millis % 2000;
        // Short flashes: 100 ms on, 200 ms off.
        let flashes = |count| in_two_seconds / 300 < count && in_two_seconds % 300 < 100;
        match self {
            Signal::Boot => true,
            Signal::Idle => flashes(1),
            Signal::Released => flashes(2),
            Signal::Inhibited => flashes(3),
            Signal::Shadow => in_two_seconds < 500,
            Signal::Waiting => millis % 1000 < 500,
            Signal::Commanding => millis % 1000 >= 100,
            Signal::Fault => millis % 200 < 100,
        }
    }
}

/// An LED on an output pin. It writes the pin on changes only, and ignores a pin that cannot be written: a broken LED
/// does not end a flight.
pub struct StatusLed<P> {
    pin: P,
    lights: PinState,
    lit: Option<bool>,
}

impl<P: OutputPin> StatusLed<P> {
    /// An LED on `pin`, which may show anything until the first [`StatusLed::show`]; `lights` is the level that lights
    /// it.
    pub const fn new(pin: P, lights: PinState) -> StatusLed<P> {
        StatusLed { pin, lights, lit: None }
    }

    /// Shows `signal`. Call it in every iteration of the decision loop.
    pub fn show(&mut self, now: Instant, signal: Signal) {
        let lit = signal.is_lit(now);
        if self.lit != Some(lit) {
            let level = if lit { self.lights } else { !self.lights };
            self.lit = self.pin.set_state(level).is_ok().then_some(lit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doubles::Output;
    use std::collections::BTreeSet;
    use std::vec::Vec;

    const SIGNALS: [Signal; 8] = [
        Signal::Boot,
        Signal::Idle,
        Signal::Shadow,
        Signal::Waiting,
        Signal::Commanding,
        Signal::Released,
        Signal::Inhibited,
        Signal::Fault,
    ];

    /// The pattern over two seconds, every 20 ms, as the decision loop shows it.
    fn pattern(signal: Signal) -> Vec<bool> {
        (0..100).map(|tick| signal.is_lit(Instant::from_millis(10_000 + tick * 20))).collect()
    }

    fn flashes(signal: Signal) -> usize {
        let pattern = pattern(signal);
        (0..100).filter(|&at| pattern[at] && !pattern[(at + 99) % 100]).count()
    }

    #[test]
    fn every_signal_has_a_pattern_of_its_own() {
        let patterns: BTreeSet<Vec<bool>> = SIGNALS.iter().map(|&signal| pattern(signal)).collect();
        assert_eq!(patterns.len(), SIGNALS.len());
        for signal in &SIGNALS[1..] {
            let pattern = pattern(*signal);
            assert!(
                pattern.contains(&true) && pattern.contains(&false),
                "{signal:?} looks like a dead board"
            );
        }
        let counts = [Signal::Idle, Signal::Released, Signal::Inhibited, Signal::Waiting, Signal::Fault];
        assert_eq!(counts.map(flashes), [1, 2, 3, 2, 10]);
    }

    #[test]
    fn the_inhibit_input_shows_on_the_ground_only() {
        for (state, signal) in [
            (State::Idle, Signal::Inhibited),
            (State::Waiting, Signal::Inhibited),
            (State::Engaged, Signal::Commanding),
            (State::Homing, Signal::Commanding),
            (State::Fault, Signal::Fault),
        ] {
            assert_eq!(Signal::of(state, true), signal, "{state:?}");
        }
        assert_eq!(Signal::of(State::Idle, false), Signal::Idle);
        assert_eq!(Signal::of(State::Passive, false), Signal::Released);
    }

    #[test]
    fn the_pin_is_written_on_changes_only_with_the_board_s_level() {
        let pin = Output::new();
        let mut led = StatusLed::new(pin.clone(), PinState::Low);
        for tick in 0..100 {
            // The double panics when a level is written twice.
            led.show(Instant::from_millis(tick * 20), Signal::Released);
        }
        let levels = [PinState::Low, PinState::High, PinState::Low, PinState::High];
        assert_eq!(pin.written(), levels);
    }

    #[test]
    fn a_pin_that_fails_is_tried_again() {
        let pin = Output::new();
        let mut led = StatusLed::new(pin.clone(), PinState::High);
        pin.fail(true);
        led.show(Instant::ZERO, Signal::Boot);
        pin.fail(false);
        led.show(Instant::ZERO, Signal::Boot);
        assert_eq!(pin.written(), [PinState::High]);
    }
}
