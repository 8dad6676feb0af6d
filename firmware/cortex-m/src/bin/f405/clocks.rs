//! Clocks: crystal, PLL, 168 MHz, or as much of it as works.
//!
//! Every wait has a limit, so that a dead crystal does not stop the boot: the internal oscillator then drives the PLL,
//! and with a dead PLL the core stays on its 16 MHz.

use gleaner_cortex_m::ResetFlags;
use stm32f4::stm32f405::{FLASH, RCC};

/// Frequency of the board's crystal, MHz; 4 to 26 are possible (RM0090, 7.2.1).
const CRYSTAL_MHZ: u8 = 8;
const INTERNAL_MHZ: u8 = 16;
/// Iterations of a wait, about 10 cycles each: 100 ms at 16 MHz, 50 times the crystal's start (DS8626, 6.3.8).
const WAIT_ITERATIONS: u32 = 160_000;

/// The clock of the core.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// 168 MHz from the PLL, from the crystal or from the internal oscillator.
    Pll,
    /// 16 MHz, the internal oscillator.
    Internal,
}

impl Clock {
    /// Frequency of the core.
    pub const fn core_mhz(self) -> u32 {
        match self {
            Clock::Pll => 168,
            Clock::Internal => INTERNAL_MHZ as u32,
        }
    }

    /// Frequency of the bus of USART2, USART3 and UART4.
    pub const fn apb1_hz(self) -> u32 {
        match self {
            Clock::Pll => 42_000_000,
            Clock::Internal => 16_000_000,
        }
    }
}

/// Starts the fastest clock that works.
pub fn start(rcc: &RCC, flash: &FLASH) -> Clock {
    // The ready bits are read-only on the chip. They are written here for emulators that model the register as plain
    // memory and would never report ready.
    rcc.cr().modify(|r, w| unsafe { w.bits(r.bits() | HSI_READY | HSE_READY).hseon().set_bit() });
    let crystal = wait(|| rcc.cr().read().hserdy().bit_is_set());
    let input_mhz = if crystal { CRYSTAL_MHZ } else { INTERNAL_MHZ };
    rcc.pllcfgr().write(|w| {
        // 1 MHz * 336 / 2 = 168 MHz; / 7 = 48 MHz.
        let w = unsafe { w.pllm().bits(input_mhz).plln().bits(336).pllq().bits(7) };
        w.pllp().div2().pllsrc().bit(crystal)
    });
    rcc.cr().modify(|r, w| unsafe { w.bits(r.bits() | PLL_READY).pllon().set_bit() });
    if !wait(|| rcc.cr().read().pllrdy().bit_is_set()) {
        rcc.cr().modify(|_, w| w.pllon().clear_bit());
        return Clock::Internal;
    }
    // RM0090, table 10: 5 wait states above 150 MHz at 2.7 V or more. Cache and prefetch hide most of them.
    flash.acr().write(|w| w.latency().ws5().prften().set_bit().icen().set_bit().dcen().set_bit());
    rcc.cfgr().modify(|_, w| w.hpre().div1().ppre1().div4().ppre2().div2());
    rcc.cfgr().modify(|r, w| unsafe { w.bits(r.bits() | PLL_IS_CLOCK).sw().pll() });
    if !wait(|| rcc.cfgr().read().sws().is_pll()) {
        rcc.cfgr().modify(|_, w| w.sw().hsi().ppre1().div1().ppre2().div1());
        return Clock::Internal;
    }
    if crystal {
        rcc.cr().modify(|_, w| w.csson().set_bit());
    }
    Clock::Pll
}

const HSI_READY: u32 = 1 << 1;
const HSE_READY: u32 = 1 << 17;
const PLL_READY: u32 = 1 << 25;
/// The PLL as reported in `SWS`.
const PLL_IS_CLOCK: u32 = 0b10 << 2;

fn wait(mut is_ready: impl FnMut() -> bool) -> bool {
    (0..WAIT_ITERATIONS).any(|_| is_ready())
}

/// Reads the cause of the reset and clears the flags, so that they describe one reset only.
pub fn take_reset_flags(rcc: &RCC) -> ResetFlags {
    let csr = rcc.csr().read();
    let flags = ResetFlags {
        watchdog: csr.wdgrstf().bit_is_set(),
        power: csr.porrstf().bit_is_set() || csr.borrstf().bit_is_set(),
    };
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    flags
}
