//! The end of the program: stop transmitting, say why in RAM that no one clears, reset.
//!
//! A reset alone already silences the ports. The transmitters are stopped first all the same, so that nothing
//! half-written can leave while the words are kept.
#![allow(unsafe_code)]

use super::lines::gleaner_silence;
use crate::{Cause, LastWords};
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

unsafe extern "C" {
    /// RAM that the memory map keeps out of every section: nothing clears it at a start, so it holds the last words
    /// over a reset, and noise after power was off.
    // SAFETY: aligned and large enough by the memory map; every bit pattern is a valid u32.
    safe static _last_words: [AtomicU32; 5];
}

/// What is kept in RAM.
pub(super) fn last_words() -> LastWords {
    LastWords::from_words(core::array::from_fn(|at| {
        _last_words.get(at).map_or(0, |word| word.load(Ordering::Relaxed))
    }))
}

/// Keeps words over a reset.
pub(super) fn keep(words: LastWords) {
    for (slot, word) in _last_words.iter().zip(words.words()) {
        slot.store(word, Ordering::Relaxed);
    }
}

/// Ends the program: silent, with its last words kept, by a reset.
pub fn end(cause: Cause) -> ! {
    cortex_m::interrupt::disable();
    gleaner_silence();
    keep(last_words().ended(cause));
    SCB::sys_reset()
}

// SAFETY: takes the place of the default handler; nothing of the faulted program is used again.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    end(Cause::HardFault { at: frame.pc() })
}

// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(interrupt: i16) -> ! {
    end(Cause::Unexpected { interrupt: interrupt as u32 })
}

/// Stands in a section of its own, so that the link can tell whether a panic can be reached at all.
// SAFETY: an ordinary function in a section of flash that is kept for it.
#[unsafe(link_section = ".gleaner_panic")]
#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    end(Cause::Panic { line: info.location().map_or(0, core::panic::Location::line) })
}
