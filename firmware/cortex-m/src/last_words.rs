//! Why the program before this one ended.

use core::fmt;

/// What ended it, as far as its own handlers noticed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A panic, in this line of its file.
    Panic {
        /// The line; the file is in the log.
        line: u32,
    },
    /// A hard fault: memory that is not there, an instruction that is none, a stack that overflowed.
    HardFault {
        /// Where, as an address of the program.
        at: u32,
    },
    /// The crystal stopped (clock security system).
    ClockFailed,
    /// An interrupt that no one serves.
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

/// What the reset controller remembers of the reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetFlags {
    /// The independent watchdog: the decision loop stood still.
    pub watchdog: bool,
    /// The supply was off or too low: RAM holds nothing.
    pub power: bool,
}

/// A record in RAM that no one initialises: it outlives a reset, and is noise after power was off.
///
/// The words are a magic number, whether the aircraft was being steered, the kind of end and its detail, and the
/// sum of all of them as a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastWords {
    words: [u32; 5],
}

const MAGIC: u32 = 0x474C_4E52;
const ALIVE: u32 = 0;
const PANIC: u32 = 1;
const HARD_FAULT: u32 = 2;
const CLOCK_FAILED: u32 = 3;
const UNEXPECTED: u32 = 4;

impl LastWords {
    /// The program runs; `steering` is whether it steers the aircraft.
    #[must_use]
    pub const fn alive(steering: bool) -> LastWords {
        LastWords::sealed(steering as u32, ALIVE, 0)
    }

    /// What was kept, whole or not.
    #[must_use]
    pub const fn from_words(words: [u32; 5]) -> LastWords {
        LastWords { words }
    }

    /// What to keep.
    #[must_use]
    pub const fn words(self) -> [u32; 5] {
        self.words
    }

    /// The same program with its end.
    #[must_use]
    pub const fn ended(self, cause: Cause) -> LastWords {
        let steering = if self.is_whole() { self.words[1] } else { 0 };
        match cause {
            Cause::Panic { line } => LastWords::sealed(steering, PANIC, line),
            Cause::HardFault { at } => LastWords::sealed(steering, HARD_FAULT, at),
            Cause::ClockFailed => LastWords::sealed(steering, CLOCK_FAILED, 0),
            Cause::Unexpected { interrupt } => LastWords::sealed(steering, UNEXPECTED, interrupt),
        }
    }

    const fn sealed(steering: u32, kind: u32, detail: u32) -> LastWords {
        let sum = LastWords::sum(steering, kind, detail);
        LastWords { words: [MAGIC, steering, kind, detail, sum] }
    }

    const fn sum(steering: u32, kind: u32, detail: u32) -> u32 {
        !(MAGIC.wrapping_add(steering).wrapping_add(kind.wrapping_mul(31)).wrapping_add(detail))
    }

    const fn is_whole(self) -> bool {
        let [magic, steering, kind, detail, sum] = self.words;
        magic == MAGIC && sum == LastWords::sum(steering, kind, detail)
    }

    /// What to tell after a reset; `None` after an ordinary start.
    #[must_use]
    pub fn told(self, flags: ResetFlags) -> Option<Obituary> {
        if flags.power || !self.is_whole() {
            return flags.watchdog.then_some(Obituary { cause: None, watchdog: true, steering: false });
        }
        let [_, steering, kind, detail, _] = self.words;
        let cause = match kind {
            PANIC => Some(Cause::Panic { line: detail }),
            HARD_FAULT => Some(Cause::HardFault { at: detail }),
            CLOCK_FAILED => Some(Cause::ClockFailed),
            UNEXPECTED => Some(Cause::Unexpected { interrupt: detail }),
            _ => None,
        };
        Some(Obituary { cause, watchdog: flags.watchdog, steering: steering != 0 })
    }
}

/// What is known of the end of the program before this one. Its text fits one `STATUSTEXT`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Obituary {
    /// What its own handlers noticed.
    pub cause: Option<Cause>,
    /// Whether the watchdog ended it.
    pub watchdog: bool,
    /// Whether it was steering the aircraft.
    pub steering: bool,
}

impl fmt::Display for Obituary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = if self.steering { " in flight" } else { "" };
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
    fn every_end_is_told_in_one_status_text() {
        let told = |words: LastWords, flags| format!("gleaner: {}", words.told(flags).unwrap());
        let flying = LastWords::alive(true);
        let idle = LastWords::alive(false);
        assert_eq!(told(flying, WATCHDOG), "gleaner: restarted in flight: watchdog");
        assert_eq!(told(idle, NONE), "gleaner: restarted: reset");
        let fault = Cause::HardFault { at: 0x0801_2345 };
        assert_eq!(told(flying.ended(fault), NONE), "gleaner: restarted in flight: fault at 0x08012345");
        for cause in
            [Cause::Panic { line: 99_999 }, fault, Cause::ClockFailed, Cause::Unexpected { interrupt: 81 }]
        {
            let words = flying.ended(cause);
            assert_eq!(words.told(NONE).unwrap().cause, Some(cause));
            assert!(told(words, NONE).len() <= 50, "{}", told(words, NONE));
        }
    }

    #[test]
    fn noise_and_an_ordinary_start_tell_nothing() {
        assert_eq!(LastWords { words: [0; 5] }.told(NONE), None);
        let mut words = LastWords::alive(true);
        words.words[3] ^= 4;
        assert_eq!(words.told(NONE), None);
        assert_eq!(LastWords::alive(true).told(ResetFlags { power: true, watchdog: false }), None);
        let unknown = LastWords { words: [7; 5] }.told(WATCHDOG).unwrap();
        assert_eq!(unknown, Obituary { cause: None, watchdog: true, steering: false });
        assert!(!LastWords { words: [9; 5] }.ended(Cause::ClockFailed).told(NONE).unwrap().steering);
    }
}
