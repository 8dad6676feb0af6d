//! The status LED and the engage-inhibit input of a board.

use crate::{EngageInhibit, Signal, StatusLed};
use embedded_hal::digital::{InputPin, OutputPin};
use gleaner_pilot::State;
use gleaner_units::Instant;

/// The LED and the switch on the aircraft.
pub struct Panel<L, I> {
    led: StatusLed<L>,
    inhibit: EngageInhibit<I>,
}

impl<L: OutputPin, I: InputPin> Panel<L, I> {
    /// A panel whose LED shows [`Signal::Boot`] at once.
    pub fn new(mut led: StatusLed<L>, inhibit: EngageInhibit<I>) -> Panel<L, I> {
        led.show(Instant::ZERO, Signal::Boot);
        Panel { led, inhibit }
    }

    /// Reads the input and shows the state; returns whether engaging is inhibited. Call it after each poll of the
    /// pilot.
    pub fn poll(&mut self, now: Instant, state: State) -> bool {
        let inhibited = self.inhibit.poll(now);
        self.led.show(now, Signal::of(state, inhibited));
        inhibited
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doubles::{Input, Output};
    use embedded_hal::digital::PinState;

    #[test]
    fn the_led_is_lit_during_boot_and_then_shows_the_input() {
        let (pin, line) = (Output::new(), Input::new(Some(PinState::High)));
        let led = StatusLed::new(pin.clone(), PinState::High);
        let mut panel = Panel::new(led, EngageInhibit::new(line.clone(), PinState::Low));
        assert_eq!(pin.written(), [PinState::High]);
        let mut flashes = |from: u64| {
            let before = pin.written().iter().filter(|&&level| level == PinState::High).count();
            let inhibited =
                (0..100).map(|tick| panel.poll(Instant::from_millis(from + tick * 20), State::Idle)).last();
            let after = pin.written().iter().filter(|&&level| level == PinState::High).count();
            (after - before, inhibited)
        };
        assert_eq!(flashes(4200), (3, Some(true)));
        line.set(Some(PinState::Low));
        flashes(6200);
        assert_eq!(flashes(8200), (1, Some(false)));
    }
}
