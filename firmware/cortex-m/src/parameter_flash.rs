//! The two flash sectors that hold the parameters, as `embedded-storage` sees them, over a chip's flash controller.
//!
//! Bounds, unlocking and locking, waiting and error checks are the same on every chip and stand here; a chip adds its
//! registers ([`FlashController`]).

use core::fmt;
use embedded_hal::delay::DelayNs;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Sectors that the parameters have.
const SECTORS: u32 = 2;
/// Time between two reads of the busy flag.
const POLL_US: u32 = 10;

/// The registers that erase and write a chip's flash, limited to the parameters' two sectors. Offsets count bytes from
/// the start of the first one.
pub trait FlashController {
    /// Bytes of a sector.
    const SECTOR_BYTES: usize;
    /// The unit of writing, bytes.
    const WRITE_BYTES: usize;
    /// Longest time that one operation takes, by the datasheet.
    const OPERATION_LIMIT_MS: u32;

    /// Reads from `offset`, a multiple of four. The range lies inside the two sectors.
    fn read(&self, offset: u32, bytes: &mut [u8]);
    /// Unlocks the control register and clears old error flags.
    fn unlock(&mut self);
    /// Starts to erase sector 0 or 1. False when the controller does not accept the request: it is locked until the
    /// next reset, or absent.
    fn start_erase(&mut self, sector: u32) -> bool;
    /// Starts to write one unit at `offset`, a multiple of the unit. False as above.
    fn start_write(&mut self, offset: u32, unit: &[u8]) -> bool;
    /// Whether the operation is still running.
    fn is_busy(&self) -> bool;
    /// Whether the operation has failed.
    fn has_failed(&self) -> bool;
    /// Locks the control register and discards caches of what was there before.
    fn lock(&mut self);
}

/// The flash did not do what was requested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// The range is outside the sectors or not aligned.
    Range,
    /// The controller refused, failed, or stayed busy.
    Refused,
}

impl fmt::Display for FlashError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FlashError::Range => "outside the parameters' flash",
            FlashError::Refused => "the flash refused the operation",
        })
    }
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            FlashError::Range => NorFlashErrorKind::OutOfBounds,
            FlashError::Refused => NorFlashErrorKind::Other,
        }
    }
}

/// The parameters' sectors.
pub struct ParameterFlash<C, D> {
    controller: C,
    delay: D,
}

impl<C: FlashController, D: DelayNs> ParameterFlash<C, D> {
    const BYTES: u32 = SECTORS * C::SECTOR_BYTES as u32;

    /// The sectors behind `controller`; `delay` paces the waiting.
    pub const fn new(controller: C, delay: D) -> ParameterFlash<C, D> {
        ParameterFlash { controller, delay }
    }

    /// One operation between unlocking and locking.
    fn operate(&mut self, start: impl FnOnce(&mut C) -> bool) -> Result<(), FlashError> {
        self.controller.unlock();
        let done = start(&mut self.controller) && self.wait() && !self.controller.has_failed();
        self.controller.lock();
        if done { Ok(()) } else { Err(FlashError::Refused) }
    }

    fn wait(&mut self) -> bool {
        for _ in 0..=C::OPERATION_LIMIT_MS * 1000 / POLL_US {
            if !self.controller.is_busy() {
                return true;
            }
            self.delay.delay_us(POLL_US);
        }
        false
    }
}

/// Whether `from..to` lies inside `size` and both ends are multiples of `unit`.
fn check(from: u32, to: u32, size: u32, unit: usize) -> Result<(), FlashError> {
    let unit = unit as u32;
    let aligned = from.is_multiple_of(unit) && to.is_multiple_of(unit);
    if aligned && from <= to && to <= size { Ok(()) } else { Err(FlashError::Range) }
}

/// The offset after `bytes` bytes at `offset`; the maximum when it does not fit, which no check accepts.
fn end(offset: u32, bytes: &[u8]) -> u32 {
    u32::try_from(bytes.len()).ok().and_then(|count| offset.checked_add(count)).unwrap_or(u32::MAX)
}

impl<C, D> ErrorType for ParameterFlash<C, D> {
    type Error = FlashError;
}

impl<C: FlashController, D: DelayNs> ReadNorFlash for ParameterFlash<C, D> {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        check(offset, end(offset, bytes), Self::BYTES, Self::READ_SIZE)?;
        self.controller.read(offset, bytes);
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::BYTES as usize
    }
}

impl<C: FlashController, D: DelayNs> NorFlash for ParameterFlash<C, D> {
    const WRITE_SIZE: usize = C::WRITE_BYTES;
    const ERASE_SIZE: usize = C::SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        check(from, to, Self::BYTES, C::SECTOR_BYTES)?;
        let sector_bytes = C::SECTOR_BYTES as u32;
        for sector in from / sector_bytes..to / sector_bytes {
            self.operate(|controller| controller.start_erase(sector))?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        check(offset, end(offset, bytes), Self::BYTES, C::WRITE_BYTES)?;
        let offsets = (offset..).step_by(C::WRITE_BYTES);
        for (at, unit) in offsets.zip(bytes.chunks_exact(C::WRITE_BYTES)) {
            self.operate(|controller| controller.start_write(at, unit))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
