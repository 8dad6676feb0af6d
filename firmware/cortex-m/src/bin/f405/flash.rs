//! The parameters' sectors (RM0090, 3.4 and 3.6).
//!
//! Program and flash share one bank: while a sector is erased the processor stands still at its next fetch, for a
//! quarter of a second, at most half of one. A word takes 16 microseconds.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use gleaner_cortex_m::bare::{Refused, parameter_bytes, parameter_place};
use stm32f4::stm32f405::FLASH;

const SECTOR_BYTES: usize = 16 * 1024;
const SECTORS: usize = 2;
/// The first sector of the two, by its number on the chip.
const FIRST_SECTOR: u8 = 1;
/// Turns of a waiting loop: some seconds, were it ever to wait here and not at a fetch.
const PATIENCE: u32 = 50_000_000;

/// Two sectors of flash.
pub struct ParameterSectors {
    registers: FLASH,
}

impl ParameterSectors {
    /// The sectors, with the registers that write them.
    pub const fn new(registers: FLASH) -> ParameterSectors {
        ParameterSectors { registers }
    }

    /// Runs one operation between unlocking and locking. `prepare` sets what it is to be; a control register that
    /// does not keep it (locked for good, or not there) means that a write would be a fault.
    fn operate(&mut self, wanted: u32, run: impl FnOnce(&FLASH)) -> Result<(), Refused> {
        let flash = &self.registers;
        // RM0090, 3.6.1: the two keys, in this order.
        flash.keyr().write(|w| unsafe { w.bits(0x4567_0123) });
        flash.keyr().write(|w| unsafe { w.bits(0xCDEF_89AB) });
        // Errors of before; a flag is cleared by writing it.
        flash.sr().write(|w| unsafe { w.bits(ERRORS | 1) });
        flash.cr().write(|w| unsafe { w.bits(wanted) });
        let result = if flash.cr().read().bits() & !LOCKED == wanted {
            run(flash);
            let done = (0..PATIENCE).any(|_| flash.sr().read().bsy().bit_is_clear());
            if done && flash.sr().read().bits() & ERRORS == 0 { Ok(()) } else { Err(Refused) }
        } else {
            Err(Refused)
        };
        flash.cr().write(|w| unsafe { w.bits(LOCKED) });
        // RM0090, 3.5.2: the data cache still holds what was there before.
        flash.acr().modify(|_, w| w.dcen().clear_bit());
        flash.acr().modify(|_, w| w.dcrst().set_bit());
        flash.acr().modify(|_, w| w.dcrst().clear_bit());
        flash.acr().modify(|_, w| w.dcen().set_bit());
        result
    }
}

const PROGRAM: u32 = 1;
const ERASE_SECTOR: u32 = 1 << 1;
const START: u32 = 1 << 16;
const WORDS: u32 = 0b10 << 8;
const LOCKED: u32 = 1 << 31;
/// Write protection, alignment, parallelism, sequence.
const ERRORS: u32 = 0xF0;

impl ErrorType for ParameterSectors {
    type Error = Refused;
}

impl ReadNorFlash for ParameterSectors {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
        parameter_bytes(offset, bytes)
    }

    fn capacity(&self) -> usize {
        SECTORS * SECTOR_BYTES
    }
}

impl NorFlash for ParameterSectors {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
        for sector in from as usize / SECTOR_BYTES..to as usize / SECTOR_BYTES {
            if sector >= SECTORS {
                return Err(Refused);
            }
            let number = u32::from(FIRST_SECTOR) + sector as u32;
            let wanted = WORDS | ERASE_SECTOR | number << 3;
            self.operate(wanted, |flash| {
                flash.cr().write(|w| unsafe { w.bits(wanted | START) });
            })?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        for (index, four) in bytes.chunks_exact(4).enumerate() {
            let word = four.first_chunk().map_or(u32::MAX, |bytes| u32::from_le_bytes(*bytes));
            let place = parameter_place(offset + index as u32 * 4)?;
            // SAFETY: a word inside the sectors, where only parameters stand.
            self.operate(WORDS | PROGRAM, |_| unsafe { place.write_volatile(word) })?;
        }
        Ok(())
    }
}
