//! The board program for the STM32F405.
//!
//! | signal | peripheral | pins |
//! |---|---|---|
//! | autopilot, MAVLink 2, 921600 baud | USART2 | PA2 transmit, PA3 receive |
//! | radio, COBS reports, 115200 baud | USART3 | PB10 transmit, PB11 receive |
//! | log, defmt, 115200 baud | UART4 | PC10 transmit |
//! | status LED, lit when low | GPIO | PC12 |
//! | engage inhibit, pulled up; low permits | GPIO | PC6 |
#![no_std]
#![no_main]
#![warn(missing_docs)]

mod clocks;
mod flash;
mod serial;

use crate::flash::Controller;
use cortex_m_rt::{entry, exception};
use embedded_hal::digital::PinState;
use gleaner_cortex_m::bare::stm32::{Gpio, Input, Output, watchdog};
use gleaner_cortex_m::bare::{self, SysTickDelay};
use gleaner_cortex_m::{Board, Cause, Parts};
use stm32f4::stm32f405::{GPIOC, IWDG, Peripherals};

struct F405;

impl Board for F405 {
    type Flash = Controller;
    type Delay = SysTickDelay;
    type Led = Output;
    type Inhibit = Input;

    const LED_LIGHTS: PinState = PinState::Low;
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

fn bring_up(core: cortex_m::Peripherals, chip: Peripherals) -> Parts<F405> {
    let reset_flags = clocks::take_reset_flags(&chip.RCC);
    let clock = clocks::start(&chip.RCC, &chip.FLASH);
    let delay = bare::start_clock(core.SYST, clock.core_mhz());
    serial::start(&chip, clock.apb1_hz());
    // SAFETY: a port whose clock the serial lines have enabled; only they use other pins of it.
    let port_c = unsafe { Gpio::new(GPIOC::ptr().cast()) };
    Parts {
        reset_flags,
        flash: Controller::new(chip.FLASH),
        delay,
        led: port_c.output(12),
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

/// The clock security system: the crystal stopped, the core continues at 16 MHz (RM0090, 7.2.7).
// SAFETY: never returns to the interrupted program.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    bare::end(Cause::ClockFailed)
}
