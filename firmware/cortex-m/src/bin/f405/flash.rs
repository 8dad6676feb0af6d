//! The flash controller (RM0090, 3.4 and 3.6).
//!
//! Program and parameters share one bank: erasing a sector stops the processor at its next instruction fetch, for
//! 0.25 s, at most 0.5 s. Writing a word takes 16 microseconds.

use gleaner_cortex_m::FlashController;
use gleaner_cortex_m::bare::{parameter_bytes, parameter_place};
use stm32f4::stm32f405::FLASH;

/// Number of the first parameter sector on the chip.
const FIRST_SECTOR: u32 = 1;

const PROGRAM: u32 = 1;
const ERASE_SECTOR: u32 = 1 << 1;
const START: u32 = 1 << 16;
const WORDS: u32 = 0b10 << 8;
const LOCKED: u32 = 1 << 31;
const END_OF_OPERATION: u32 = 1;
/// Write protection, alignment, parallelism and sequence errors.
const ERRORS: u32 = 0xF0;

/// The flash registers.
pub struct Controller(FLASH);

impl Controller {
    /// The controller behind these registers.
    pub const fn new(registers: FLASH) -> Controller {
        Controller(registers)
    }

    /// Sets the kind of operation. A register that does not hold it would turn the following write into a bus fault.
    fn prepare(&mut self, operation: u32) -> bool {
        self.0.cr().write(|w| unsafe { w.bits(operation) });
        self.0.cr().read().bits() & !LOCKED == operation
    }
}

impl FlashController for Controller {
    const SECTOR_BYTES: usize = 16 * 1024;
    const WRITE_BYTES: usize = 4;
    /// DS8626, table 41: 500 ms at most for a sector of 16 KB.
    const OPERATION_LIMIT_MS: u32 = 800;

    fn read(&self, offset: u32, bytes: &mut [u8]) {
        parameter_bytes(offset, bytes);
    }

    /// RM0090, 3.6.1: the two keys, in this order. An error flag is cleared by writing it.
    fn unlock(&mut self) {
        self.0.keyr().write(|w| unsafe { w.bits(0x4567_0123) });
        self.0.keyr().write(|w| unsafe { w.bits(0xCDEF_89AB) });
        self.0.sr().write(|w| unsafe { w.bits(ERRORS | END_OF_OPERATION) });
    }

    fn start_erase(&mut self, sector: u32) -> bool {
        let operation = WORDS | ERASE_SECTOR | (FIRST_SECTOR + sector) << 3;
        let accepted = self.prepare(operation);
        if accepted {
            self.0.cr().write(|w| unsafe { w.bits(operation | START) });
        }
        accepted
    }

    fn start_write(&mut self, offset: u32, unit: &[u8]) -> bool {
        let (Some(place), Some(word)) = (parameter_place(offset), unit.first_chunk()) else { return false };
        let accepted = self.prepare(WORDS | PROGRAM);
        if accepted {
            // SAFETY: a word inside the sectors, which hold nothing but parameters.
            unsafe { place.write_volatile(u32::from_le_bytes(*word)) };
        }
        accepted
    }

    fn is_busy(&self) -> bool {
        self.0.sr().read().bsy().bit_is_set()
    }

    fn has_failed(&self) -> bool {
        self.0.sr().read().bits() & ERRORS != 0
    }

    /// RM0090, 3.5.2: the data cache still holds the old contents.
    fn lock(&mut self) {
        self.0.cr().write(|w| unsafe { w.bits(LOCKED) });
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().clear_bit());
        self.0.acr().modify(|_, w| w.dcen().set_bit());
    }
}
