//! The board program for the STM32H743, a Cortex-M7: the second board, to show what a port takes.
//!
//! It links and has run on nothing yet. Pins and speeds are those of the first board; the core runs on its 64 MHz
//! internal oscillator from the start, so there are no clocks to bring up, and its caches stay off.
#![no_std]
#![no_main]
#![warn(missing_docs)]

mod flash;
mod lines;

use crate::flash::ParameterSectors;
use cortex_m_rt::entry;
use gleaner_cortex_m::bare::{self, Board};
use gleaner_cortex_m::{Cause, ResetFlags};
use stm32h7::stm32h743::{IWDG, Peripherals, RCC};

/// RM0433, 8.7.2: the internal oscillator after a reset, for the core and all buses.
const CLOCK_MHZ: u32 = 64;

struct H743 {
    flash: ParameterSectors,
    reset_flags: ResetFlags,
}

impl Board for H743 {
    type Flash = ParameterSectors;

    fn flash(self) -> ParameterSectors {
        self.flash
    }

    fn reset_flags(&self) -> ResetFlags {
        self.reset_flags
    }

    /// RM0433, 46.3: prescaler 32 (code 3) and 1000 steps are a second of the 32 kHz oscillator.
    fn start_watchdog() {
        watchdog().kr().write(|w| w.key().start());
        watchdog().kr().write(|w| w.key().unlock());
        watchdog().pr().write(|w| unsafe { w.bits(3) });
        watchdog().rlr().write(|w| unsafe { w.bits(1000) });
        H743::feed_watchdog();
    }

    fn feed_watchdog() {
        watchdog().kr().write(|w| w.key().feed());
    }
}

fn watchdog() -> &'static stm32h7::stm32h743::iwdg::RegisterBlock {
    // SAFETY: nothing else touches these registers.
    unsafe { &*IWDG::ptr() }
}

/// RM0433, 8.7.39. The flags are cleared, so that they tell of one reset only.
fn take_reset_flags(rcc: &RCC) -> ResetFlags {
    let rsr = rcc.rsr().read();
    let flags = ResetFlags {
        watchdog: rsr.iwdg1rstf().bit_is_set(),
        power: rsr.porrstf().bit_is_set() || rsr.borrstf().bit_is_set(),
    };
    rcc.rsr().modify(|_, w| w.rmvf().set_bit());
    flags
}

#[entry]
fn main() -> ! {
    // Both are there once; without them there is no board to run on.
    let (Some(core), Some(chip)) = (cortex_m::Peripherals::take(), Peripherals::take()) else {
        bare::end(Cause::Panic { line: line!() })
    };
    let reset_flags = take_reset_flags(&chip.RCC);
    bare::start_clock(core.SYST, CLOCK_MHZ);
    lines::start(&chip, CLOCK_MHZ * 1_000_000);
    bare::fly(H743 { flash: ParameterSectors::new(chip.FLASH), reset_flags })
}
