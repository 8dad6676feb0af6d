//! Arbitrary bytes in the flash that keeps the parameters: nothing panics, every parameter is in its range, Gleaner never
//! starts enabled, and a save is restored.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use gleaner_cortex_m::{ParameterStore, Restored};
use gleaner_link::{Enable, PARAMETERS};

const SECTOR_BYTES: usize = 512;

/// Two sectors of memory.
#[derive(Clone)]
struct Flash([u8; 2 * SECTOR_BYTES]);

pub fn run(data: &[u8]) {
    let mut flash = Flash([0xFF; 2 * SECTOR_BYTES]);
    for (to, from) in flash.0.iter_mut().zip(data) {
        *to = *from;
    }
    let (mut store, parameters, _) = ParameterStore::open(&mut flash);
    for spec in &PARAMETERS {
        let mut checked = parameters.clone();
        let value = parameters.value(spec.id);
        assert!(checked.set_id(spec.id, value).is_ok(), "{} is {value}", spec.name);
    }
    assert_eq!(parameters.enable(), Enable::Off);
    if store.save(&parameters, true).is_ok() {
        let (_, again, restored) = ParameterStore::open(&mut flash);
        assert_eq!(again, parameters);
        assert!(matches!(restored, Restored::Saved | Restored::Older));
    }
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let from = self.0.get(offset as usize..).and_then(|rest| rest.get(..bytes.len()));
        bytes.copy_from_slice(from.ok_or(NorFlashErrorKind::OutOfBounds)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let sector = self.0.get_mut(from as usize..to as usize).ok_or(NorFlashErrorKind::OutOfBounds)?;
        sector.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let cells = self.0.get_mut(offset as usize..).and_then(|rest| rest.get_mut(..bytes.len()));
        for (cell, byte) in cells.ok_or(NorFlashErrorKind::OutOfBounds)?.iter_mut().zip(bytes) {
            // Writing clears bits; only an erase sets them.
            *cell &= byte;
        }
        Ok(())
    }
}
