//! The clock: SysTick counts milliseconds, its counter tells the microseconds between them.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::exception;
use gleaner_units::Instant;

static MILLIS: AtomicU32 = AtomicU32::new(0);
static WRAPS: AtomicU32 = AtomicU32::new(0);
static TICKS_PER_MICRO: AtomicU32 = AtomicU32::new(1);

/// Starts the clock at zero. `core_mhz` is the speed of the core.
pub fn start_clock(mut syst: SYST, core_mhz: u32) {
    TICKS_PER_MICRO.store(core_mhz, Ordering::Relaxed);
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(core_mhz * 1_000 - 1);
    syst.clear_current();
    syst.enable_interrupt();
    syst.enable_counter();
}

/// Time since [`start_clock`]. Does not go back, as long as it is not asked from an interrupt.
#[must_use]
pub fn now() -> Instant {
    loop {
        let wraps = WRAPS.load(Ordering::Relaxed);
        let millis = MILLIS.load(Ordering::Relaxed);
        let left = SYST::get_current();
        // With interrupts off (a log line being written), the tick may wait.
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

#[exception]
fn SysTick() {
    let millis = MILLIS.load(Ordering::Relaxed).wrapping_add(1);
    if millis == 0 {
        WRAPS.store(WRAPS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }
    MILLIS.store(millis, Ordering::Relaxed);
}
