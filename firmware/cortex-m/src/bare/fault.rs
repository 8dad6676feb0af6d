//! The end of the program: stop transmitting, record the cause in RAM that survives a reset, reset.
//!
//! The reset stops the transmitters too. They are stopped first so that no partial frame is sent while the record is
//! written.
#![allow(unsafe_code)]

use super::serial::gleaner_stop_transmitters;
use crate::{Cause, ResetRecord};
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

unsafe extern "C" {
    /// RAM outside every section: startup code does not clear it, so it survives a reset and is noise after a power
    /// cycle.
    // SAFETY: aligned and large enough by the memory map; every bit pattern is a valid u32.
    safe static _reset_record: [AtomicU32; 5];
}

/// The record in RAM.
pub(super) fn reset_record() -> ResetRecord {
    ResetRecord::from_words(core::array::from_fn(|at| {
        _reset_record.get(at).map_or(0, |word| word.load(Ordering::Relaxed))
    }))
}

/// Writes the record.
pub(super) fn keep(record: ResetRecord) {
    for (slot, word) in _reset_record.iter().zip(record.words()) {
        slot.store(word, Ordering::Relaxed);
    }
}

/// Ends the program: stops the transmitters, records the cause, resets.
pub fn end(cause: Cause) -> ! {
    cortex_m::interrupt::disable();
    gleaner_stop_transmitters();
    keep(reset_record().ended(cause));
    SCB::sys_reset()
}

// SAFETY: replaces the default handler and never returns to the faulted program.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    end(Cause::HardFault { at: frame.pc() })
}

// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(interrupt: i16) -> ! {
    end(Cause::Unexpected { interrupt: interrupt as u32 })
}

/// Placed in a section of its own: the linker script asserts that it is empty, which means no panic is reachable.
// SAFETY: an ordinary function in a flash section that is reserved for it.
#[unsafe(link_section = ".gleaner_panic")]
#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    end(Cause::Panic { line: info.location().map_or(0, core::panic::Location::line) })
}
