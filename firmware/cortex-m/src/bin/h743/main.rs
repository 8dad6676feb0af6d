//! The board program for the STM32H743, a Cortex-M7: the second board, which shows what a port needs.
//!
//! It links; it has not run on hardware. Serial pins and baud rates are those of the first board, the LED is on PB0
//! (lit when high), the inhibit input on PC6 (low permits). The core runs on its 64 MHz internal oscillator, so there
//! are no clocks to start; its caches stay off.
#![no_std]
#![no_main]
#![warn(missing_docs)]

mod flash;
mod serial;

use crate::flash::Controller;
use cortex_m_rt::entry;
use embedded_hal::digital::PinState;
use gleaner_cortex_m::bare::stm32::{Gpio, Input, Output, watchdog};
use gleaner_cortex_m::bare::{self, SysTickDelay};
use gleaner_cortex_m::{Board, Cause, Parts, ResetFlags};
use stm32h7::stm32h743::{GPIOB, GPIOC, IWDG, Peripherals, RCC};

/// RM0433, 8.7.2: the internal oscillator drives the core and all buses after a reset.
const CLOCK_MHZ: u32 = 64;

struct H743;

impl Board for H743 {
    type Flash = Controller;
    type Delay = SysTickDelay;
    type Led = Output;
    type Inhibit = Input;

    const LED_LIGHTS: PinState = PinState::High;
    const INHIBIT_PERMITS: PinState = PinState::Low;

    fn start_watchdog() {
        // SAFETY: the address of the watchdog.
        unsafe { watchdog::start(IWDG::ptr().cast()) }
    }

    fn feed_watchdog() {
        // SAFETY: as above.
        unsafe { watchdog::feed(IWDG::ptr().cast()) }
    }
}

/// RM0433, 8.7.39. Clears the flags, so that they describe one reset only.
fn take_reset_flags(rcc: &RCC) -> ResetFlags {
    let rsr = rcc.rsr().read();
    let flags = ResetFlags {
        watchdog: rsr.iwdg1rstf().bit_is_set(),
        power: rsr.porrstf().bit_is_set() || rsr.borrstf().bit_is_set(),
    };
    rcc.rsr().modify(|_, w| w.rmvf().set_bit());
    flags
}

fn bring_up(core: cortex_m::Peripherals, chip: Peripherals) -> Parts<H743> {
    let reset_flags = take_reset_flags(&chip.RCC);
    let delay = bare::start_clock(core.SYST, CLOCK_MHZ);
    serial::start(&chip, CLOCK_MHZ * 1_000_000);
    // SAFETY: ports whose clocks the serial lines have enabled; only they use other pins of them.
    let [port_b, port_c] = unsafe { [Gpio::new(GPIOB::ptr().cast()), Gpio::new(GPIOC::ptr().cast())] };
    Parts {
        reset_flags,
        flash: Controller::new(chip.FLASH),
        delay,
        led: port_b.output(0),
        inhibit: port_c.input(6),
    }
}

#[entry]
fn main() -> ! {
    match (cortex_m::Peripherals::take(), Peripherals::take()) {
        (Some(core), Some(chip)) => bare::fly(bring_up(core, chip)),
        // Only a second call could find them taken.
        _ => bare::end(Cause::Panic { line: line!() }),
    }
}
