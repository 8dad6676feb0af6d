//! The parameters' sectors: two of 128 KB in the first bank (RM0433, 4.3). The processor stands still while it fetches
//! from a bank that is being erased.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use gleaner_cortex_m::bare::{Refused, parameter_bytes, parameter_place};
use stm32h7::stm32h743::FLASH;

const SECTOR_BYTES: usize = 128 * 1024;
/// The first sector of the two, by its number in the bank.
const FIRST_SECTOR: u32 = 1;
/// The unit of writing, with its own error correction.
const FLASH_WORD_BYTES: usize = 32;
/// Turns of a waiting loop: some seconds.
const PATIENCE: u32 = 20_000_000;

const LOCKED: u32 = 1;
const PROGRAM: u32 = 1 << 1;
const ERASE_SECTOR: u32 = 1 << 2;
const WORDS_OF_64: u32 = 0b11 << 4;
const START: u32 = 1 << 7;
const BUSY_OR_QUEUED: u32 = 0b101;
/// RM0433, 4.9.5: all error flags of a bank.
const ERRORS: u32 = 0x07EE_0000;

/// Two sectors of flash.
pub struct ParameterSectors {
    registers: FLASH,
}

impl ParameterSectors {
    /// The sectors, with the registers that write them.
    pub const fn new(registers: FLASH) -> ParameterSectors {
        ParameterSectors { registers }
    }

    fn operate(&mut self, wanted: u32, run: impl FnOnce(&FLASH)) -> Result<(), Refused> {
        let (flash, bank) = (&self.registers, self.registers.bank1());
        bank.keyr().write(|w| unsafe { w.bits(0x4567_0123) });
        bank.keyr().write(|w| unsafe { w.bits(0xCDEF_89AB) });
        bank.ccr().write(|w| unsafe { w.bits(ERRORS) });
        bank.cr().write(|w| unsafe { w.bits(wanted) });
        let mut result = Err(Refused);
        if bank.cr().read().bits() == wanted {
            run(flash);
            let done = (0..PATIENCE).any(|_| bank.sr().read().bits() & BUSY_OR_QUEUED == 0);
            if done && bank.sr().read().bits() & ERRORS == 0 {
                result = Ok(());
            }
        }
        bank.cr().write(|w| unsafe { w.bits(LOCKED) });
        result
    }
}

impl ErrorType for ParameterSectors {
    type Error = Refused;
}

impl ReadNorFlash for ParameterSectors {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
        parameter_bytes(offset, bytes)
    }

    fn capacity(&self) -> usize {
        2 * SECTOR_BYTES
    }
}

impl NorFlash for ParameterSectors {
    const WRITE_SIZE: usize = FLASH_WORD_BYTES;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
        for sector in from / SECTOR_BYTES as u32..to / SECTOR_BYTES as u32 {
            if sector > 1 {
                return Err(Refused);
            }
            let wanted = WORDS_OF_64 | ERASE_SECTOR | (FIRST_SECTOR + sector) << 8;
            self.operate(wanted, |flash| {
                flash.bank1().cr().write(|w| unsafe { w.bits(wanted | START) });
            })?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        for (index, flash_word) in bytes.chunks_exact(FLASH_WORD_BYTES).enumerate() {
            let at = offset + (index * FLASH_WORD_BYTES) as u32;
            self.operate(WORDS_OF_64 | PROGRAM, |_| {
                for (word, four) in flash_word.chunks_exact(4).enumerate() {
                    let value = four.first_chunk().map_or(u32::MAX, |bytes| u32::from_le_bytes(*bytes));
                    if let Ok(place) = parameter_place(at + word as u32 * 4) {
                        // SAFETY: a word inside the sectors, where only parameters stand.
                        unsafe { place.write_volatile(value) };
                    }
                }
            })?;
        }
        Ok(())
    }
}
