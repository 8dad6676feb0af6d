//! The board program for the STM32F405: its pins, clocks and interrupts.
//!
//! | line | UART | pins | speed |
//! |---|---|---|---|
//! | autopilot, MAVLink 2 | USART2 | PA2 out, PA3 in | 921600 |
//! | radio, reports in COBS | USART3 | PB10 out, PB11 in | 115200 |
//! | log, defmt | UART4 | PC10 out | 115200 |
#![no_std]
#![no_main]
#![warn(missing_docs)]

mod clocks;
mod flash;
mod lines;

use crate::flash::ParameterSectors;
use cortex_m_rt::{entry, exception};
use gleaner_cortex_m::bare::{self, Board};
use gleaner_cortex_m::{Cause, ResetFlags};
use stm32f4::stm32f405::{IWDG, Peripherals};

struct F405 {
    flash: ParameterSectors,
    reset_flags: ResetFlags,
}

impl Board for F405 {
    type Flash = ParameterSectors;

    fn flash(self) -> ParameterSectors {
        self.flash
    }

    fn reset_flags(&self) -> ResetFlags {
        self.reset_flags
    }

    /// RM0090, 21.3: prescaler 32 and 1000 steps are a second of the 32 kHz oscillator, which may run at 17..47.
    fn start_watchdog() {
        watchdog().kr().write(|w| w.key().start());
        watchdog().kr().write(|w| w.key().unlock());
        watchdog().pr().write(|w| w.pr().divide_by32());
        watchdog().rlr().write(|w| w.rl().set(1000));
        F405::feed_watchdog();
    }

    fn feed_watchdog() {
        watchdog().kr().write(|w| w.key().feed());
    }
}

fn watchdog() -> &'static stm32f4::stm32f405::iwdg::RegisterBlock {
    // SAFETY: nothing else touches these registers.
    unsafe { &*IWDG::ptr() }
}

#[entry]
fn main() -> ! {
    // Both are there once; without them there is no board to run on.
    let (Some(core), Some(chip)) = (cortex_m::Peripherals::take(), Peripherals::take()) else {
        bare::end(Cause::Panic { line: line!() })
    };
    let reset_flags = clocks::take_reset_flags(&chip.RCC);
    let clock = clocks::start(&chip.RCC, &chip.FLASH);
    bare::start_clock(core.SYST, clock.core_mhz());
    lines::start(&chip, clock.apb1_hz());
    bare::fly(F405 { flash: ParameterSectors::new(chip.FLASH), reset_flags })
}

/// The clock security system: the crystal stopped, the core runs on at 16 MHz (RM0090, 7.2.7).
// SAFETY: touches nothing of the interrupted program, and ends it.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    bare::end(Cause::ClockFailed)
}
