//! The flash controller (RM0433, chapter 4): two parameter sectors of 128 KB in the first bank. The processor stops
//! while it fetches from a bank that is being erased.

use gleaner_cortex_m::FlashController;
use gleaner_cortex_m::bare::{parameter_bytes, parameter_place};
use stm32h7::stm32h743::FLASH;

/// Number of the first parameter sector in its bank.
const FIRST_SECTOR: u32 = 1;

const LOCKED: u32 = 1;
const PROGRAM: u32 = 1 << 1;
const ERASE_SECTOR: u32 = 1 << 2;
const WORDS_OF_64: u32 = 0b11 << 4;
const START: u32 = 1 << 7;
const BUSY_OR_QUEUED: u32 = 0b101;
/// RM0433, 4.9.5: all error flags of a bank.
const ERRORS: u32 = 0x07EE_0000;

/// The flash registers.
pub struct Controller(FLASH);

impl Controller {
    /// The controller behind these registers.
    pub const fn new(registers: FLASH) -> Controller {
        Controller(registers)
    }

    fn prepare(&mut self, operation: u32) -> bool {
        let bank = self.0.bank1();
        bank.cr().write(|w| unsafe { w.bits(operation) });
        bank.cr().read().bits() == operation
    }
}

impl FlashController for Controller {
    const SECTOR_BYTES: usize = 128 * 1024;
    /// One flash word, the unit of its error correction.
    const WRITE_BYTES: usize = 32;
    /// DS12110, table 53: 4 s at most for a sector of 128 KB.
    const OPERATION_LIMIT_MS: u32 = 4500;

    fn read(&self, offset: u32, bytes: &mut [u8]) {
        parameter_bytes(offset, bytes);
    }

    fn unlock(&mut self) {
        let bank = self.0.bank1();
        bank.keyr().write(|w| unsafe { w.bits(0x4567_0123) });
        bank.keyr().write(|w| unsafe { w.bits(0xCDEF_89AB) });
        bank.ccr().write(|w| unsafe { w.bits(ERRORS) });
    }

    fn start_erase(&mut self, sector: u32) -> bool {
        let operation = WORDS_OF_64 | ERASE_SECTOR | (FIRST_SECTOR + sector) << 8;
        let accepted = self.prepare(operation);
        if accepted {
            self.0.bank1().cr().write(|w| unsafe { w.bits(operation | START) });
        }
        accepted
    }

    fn start_write(&mut self, offset: u32, unit: &[u8]) -> bool {
        let accepted = self.prepare(WORDS_OF_64 | PROGRAM);
        for (at, four) in (offset..).step_by(4).zip(unit.chunks_exact(4)) {
            let (Some(place), Some(word)) = (parameter_place(at), four.first_chunk()) else { return false };
            if accepted {
                // SAFETY: a word inside the sectors, which hold nothing but parameters.
                unsafe { place.write_volatile(u32::from_le_bytes(*word)) };
            }
        }
        accepted
    }

    fn is_busy(&self) -> bool {
        self.0.bank1().sr().read().bits() & BUSY_OR_QUEUED != 0
    }

    fn has_failed(&self) -> bool {
        self.0.bank1().sr().read().bits() & ERRORS != 0
    }

    fn lock(&mut self) {
        self.0.bank1().cr().write(|w| unsafe { w.bits(LOCKED) });
    }
}
