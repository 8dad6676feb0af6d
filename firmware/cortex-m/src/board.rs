//! What a port to another board implements, and what runs over it after each poll of the pilot.

use crate::{
    EngageInhibit, FlashController, Panel, ParameterFlash, ParameterSaver, ResetFlags, SaveNotice, StatusLed,
};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin, PinState};
use gleaner_pilot::{Deliberator, Onboard, Parameters, State};
use gleaner_units::Instant;

/// A board. Its clocks run and its UARTs are open before it is handed over; the UARTs themselves are behind
/// [`crate::Uart`], because their interrupts own them.
pub trait Board {
    /// The flash of the parameters.
    type Flash: FlashController;
    /// A delay of microseconds, used only while the flash is busy.
    type Delay: DelayNs;
    /// The pin of the status LED.
    type Led: OutputPin;
    /// The pin of the engage-inhibit input. It MUST have a pull resistor away from
    /// [`Board::INHIBIT_PERMITS`], so that a broken wire inhibits.
    type Inhibit: InputPin;

    /// The level that lights the LED.
    const LED_LIGHTS: PinState;
    /// The level that permits engaging.
    const INHIBIT_PERMITS: PinState;

    /// Starts the watchdog: a second without a feed MUST reset the chip from now on.
    fn start_watchdog();
    /// Feeds the watchdog. [`Services::poll`] is the only caller.
    fn feed_watchdog();
}

/// The parts of a board after its start.
pub struct Parts<B: Board> {
    /// Cause of the last reset.
    pub reset_flags: ResetFlags,
    /// The flash of the parameters.
    pub flash: B::Flash,
    /// The delay.
    pub delay: B::Delay,
    /// The pin of the status LED.
    pub led: B::Led,
    /// The pin of the engage-inhibit input.
    pub inhibit: B::Inhibit,
}

/// Watchdog, panel and saved parameters: everything that follows a poll of the pilot.
pub struct Services<B: Board> {
    panel: Panel<B::Led, B::Inhibit>,
    saver: ParameterSaver<ParameterFlash<B::Flash, B::Delay>>,
}

impl<B: Board> Services<B> {
    /// Restores the parameters and lights the LED. Also returns a notice when something was lost.
    pub fn open(parts: Parts<B>) -> (Services<B>, Option<SaveNotice>) {
        let Parts { flash, delay, led, inhibit, .. } = parts;
        let panel =
            Panel::new(StatusLed::new(led, B::LED_LIGHTS), EngageInhibit::new(inhibit, B::INHIBIT_PERMITS));
        let (saver, notice) = ParameterSaver::open(ParameterFlash::new(flash, delay));
        (Services { panel, saver }, notice)
    }

    /// The parameters as they are in flash.
    pub fn parameters(&self) -> &Parameters {
        self.saver.saved()
    }

    /// Feeds the watchdog, passes the inhibit input to the pilot, shows its state, and saves changed parameters.
    /// Returns whether the pilot commands the aircraft.
    pub fn poll<P: Deliberator>(&mut self, now: Instant, onboard: &mut Onboard<P>) -> bool {
        B::feed_watchdog();
        let state = onboard.state();
        onboard.set_engage_inhibited(self.panel.poll(now, state));
        if let Some(notice) = self.saver.poll(now, onboard.parameters(), state) {
            onboard.say(notice.severity(), format_args!("{notice}"));
        }
        matches!(state, State::Engaged | State::Homing)
    }
}

#[cfg(test)]
mod tests;
