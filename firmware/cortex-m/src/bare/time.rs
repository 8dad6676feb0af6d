//! The clock: SysTick interrupts count milliseconds, its counter gives the microseconds in between.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::exception;
use embedded_hal::delay::DelayNs;
use gleaner_units::{Duration, Instant};

static MILLIS: AtomicU32 = AtomicU32::new(0);
static WRAPS: AtomicU32 = AtomicU32::new(0);
static TICKS_PER_MICRO: AtomicU32 = AtomicU32::new(1);

/// Starts the clock at zero; `core_mhz` is the core's frequency. The delay is valid from now on.
pub fn start_clock(mut syst: SYST, core_mhz: u32) -> SysTickDelay {
    TICKS_PER_MICRO.store(core_mhz, Ordering::Relaxed);
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(core_mhz * 1_000 - 1);
    syst.clear_current();
    syst.enable_interrupt();
    syst.enable_counter();
    SysTickDelay(())
}

/// Time since [`start_clock`]. Monotonic, unless called from an interrupt.
#[must_use]
pub fn now() -> Instant {
    loop {
        let wraps = WRAPS.load(Ordering::Relaxed);
        let millis = MILLIS.load(Ordering::Relaxed);
        let left = SYST::get_current();
        // While interrupts are disabled (a log frame is being written) a tick may be pending.
        let waits = SCB::is_pendst_pending();
        if (wraps, millis) != (WRAPS.load(Ordering::Relaxed), MILLIS.load(Ordering::Relaxed)) {
            continue;
        }
        let per_micro = TICKS_PER_MICRO.load(Ordering::Relaxed).max(1);
        let (left, millis) =
            if waits { (SYST::get_current(), u64::from(millis) + 1) } else { (left, millis.into()) };
        let micros = (per_micro * 1_000).wrapping_sub(1).wrapping_sub(left) / per_micro;
        let total_millis = (u64::from(wraps) << 32) + millis;
        return Instant::from_micros(total_millis * 1_000 + u64::from(micros.min(999)));
    }
}

/// A delay that waits on the clock. [`start_clock`] creates it, so the clock is running.
pub struct SysTickDelay(());

impl DelayNs for SysTickDelay {
    fn delay_ns(&mut self, ns: u32) {
        let end = now() + Duration::from_micros(u64::from(ns.div_ceil(1000)));
        while now() < end {}
    }
}

#[exception]
fn SysTick() {
    let millis = MILLIS.load(Ordering::Relaxed).wrapping_add(1);
    if millis == 0 {
        WRAPS.store(WRAPS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }
    MILLIS.store(millis, Ordering::Relaxed);
}
