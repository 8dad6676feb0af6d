//! Why the previous program ended.

use core::fmt;

/// What ended the program, as its own handlers saw it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A panic.
    Panic {
        /// Line number in the source file; the log names the file.
        line: u32,
    },
    /// A hard fault: an invalid address, an invalid instruction or a stack overflow.
    HardFault {
        /// The program counter.
        at: u32,
    },
    /// The crystal stopped (detected by the clock security system).
    ClockFailed,
    /// An interrupt without a handler.
    Unexpected {
        /// Its number.
        interrupt: u32,
    },
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cause::Panic { line } => write!(f, "panic in line {line}"),
            Cause::HardFault { at } => write!(f, "fault at {at:#010x}"),
            Cause::ClockFailed => write!(f, "crystal stopped"),
            Cause::Unexpected { interrupt } => write!(f, "interrupt {interrupt}"),
        }
    }
}

/// The cause of the reset, as the reset controller recorded it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetFlags {
    /// The independent watchdog: the decision loop had stopped.
    pub watchdog: bool,
    /// The supply was off or too low: RAM contents are invalid.
    pub power: bool,
}

/// A record in RAM that no startup code initialises: it survives a reset, and is noise after a power cycle.
///
/// The words are a magic number, whether the aircraft was being commanded, the kind of end, its detail, and a
/// checksum over all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResetRecord {
    words: [u32; 5],
}

const MAGIC: u32 = 0x474C_4E52;
const ALIVE: u32 = 0;
const PANIC: u32 = 1;
const HARD_FAULT: u32 = 2;
const CLOCK_FAILED: u32 = 3;
const UNEXPECTED: u32 = 4;

impl ResetRecord {
    /// The program is running; `commanding` is whether it commands the aircraft.
    #[must_use]
    pub const fn alive(commanding: bool) -> ResetRecord {
        ResetRecord::sealed(commanding as u32, ALIVE, 0)
    }

    /// The words found in RAM, valid or not.
    #[must_use]
    pub const fn from_words(words: [u32; 5]) -> ResetRecord {
        ResetRecord { words }
    }

    /// The words to keep.
    #[must_use]
    pub const fn words(self) -> [u32; 5] {
        self.words
    }

    /// The record of the same program after its end.
    #[must_use]
    pub const fn ended(self, cause: Cause) -> ResetRecord {
        let commanding = if self.is_valid() { self.words[1] } else { 0 };
        match cause {
            Cause::Panic { line } => ResetRecord::sealed(commanding, PANIC, line),
            Cause::HardFault { at } => ResetRecord::sealed(commanding, HARD_FAULT, at),
            Cause::ClockFailed => ResetRecord::sealed(commanding, CLOCK_FAILED, 0),
            Cause::Unexpected { interrupt } => ResetRecord::sealed(commanding, UNEXPECTED, interrupt),
        }
    }

    const fn sealed(commanding: u32, kind: u32, detail: u32) -> ResetRecord {
        let sum = ResetRecord::sum(commanding, kind, detail);
        ResetRecord { words: [MAGIC, commanding, kind, detail, sum] }
    }

    const fn sum(commanding: u32, kind: u32, detail: u32) -> u32 {
        !(MAGIC.wrapping_add(commanding).wrapping_add(kind.wrapping_mul(31)).wrapping_add(detail))
    }

    const fn is_valid(self) -> bool {
        let [magic, commanding, kind, detail, sum] = self.words;
        magic == MAGIC && sum == ResetRecord::sum(commanding, kind, detail)
    }

    /// What to report after a reset; `None` after an ordinary start.
    #[must_use]
    pub fn report(self, flags: ResetFlags) -> Option<ResetReport> {
        if flags.power || !self.is_valid() {
            return flags.watchdog.then_some(ResetReport { cause: None, watchdog: true, commanding: false });
        }
        let [_, commanding, kind, detail, _] = self.words;
        let cause = match kind {
            PANIC => Some(Cause::Panic { line: detail }),
            HARD_FAULT => Some(Cause::HardFault { at: detail }),
            CLOCK_FAILED => Some(Cause::ClockFailed),
            UNEXPECTED => Some(Cause::Unexpected { interrupt: detail }),
            _ => None,
        };
        Some(ResetReport { cause, watchdog: flags.watchdog, commanding: commanding != 0 })
    }
}

/// What is known about the end of the previous program. Its text fits one `STATUSTEXT`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResetReport {
    /// What its own handlers recorded.
    pub cause: Option<Cause>,
    /// Whether the watchdog caused the reset.
    pub watchdog: bool,
    /// Whether it was commanding the aircraft.
    pub commanding: bool,
}

impl fmt::Display for ResetReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = if self.commanding { " in flight" } else { "" };
        match self.cause {
            Some(cause) => write!(f, "restarted{place}: {cause}"),
            None if self.watchdog => write!(f, "restarted{place}: watchdog"),
            None => write!(f, "restarted{place}: reset"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    const NONE: ResetFlags = ResetFlags { watchdog: false, power: false };
    const WATCHDOG: ResetFlags = ResetFlags { watchdog: true, power: false };

    #[test]
    fn every_report_fits_one_status_text() {
        let text = |words: ResetRecord, flags| format!("gleaner: {}", words.report(flags).unwrap());
        let flying = ResetRecord::alive(true);
        let idle = ResetRecord::alive(false);
        assert_eq!(text(flying, WATCHDOG), "gleaner: restarted in flight: watchdog");
        assert_eq!(text(idle, NONE), "gleaner: restarted: reset");
        let fault = Cause::HardFault { at: 0x0801_2345 };
        assert_eq!(text(flying.ended(fault), NONE), "gleaner: restarted in flight: fault at 0x08012345");
        for cause in
            [Cause::Panic { line: 99_999 }, fault, Cause::ClockFailed, Cause::Unexpected { interrupt: 81 }]
        {
            let words = flying.ended(cause);
            assert_eq!(words.report(NONE).unwrap().cause, Some(cause));
            assert!(text(words, NONE).len() <= 50, "{}", text(words, NONE));
        }
    }

    #[test]
    fn noise_and_an_ordinary_start_report_nothing() {
        assert_eq!(ResetRecord { words: [0; 5] }.report(NONE), None);
        let mut words = ResetRecord::alive(true);
        words.words[3] ^= 4;
        assert_eq!(words.report(NONE), None);
        assert_eq!(ResetRecord::alive(true).report(ResetFlags { power: true, watchdog: false }), None);
        let unknown = ResetRecord { words: [7; 5] }.report(WATCHDOG).unwrap();
        assert_eq!(unknown, ResetReport { cause: None, watchdog: true, commanding: false });
        assert!(!ResetRecord { words: [9; 5] }.ended(Cause::ClockFailed).report(NONE).unwrap().commanding);
    }
}
