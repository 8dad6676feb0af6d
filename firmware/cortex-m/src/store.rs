//! The parameters in flash, safe against power loss.
//!
//! # Why not a crate
//! `sequential-storage` and `ekv` store arbitrary keys and decide themselves when to erase. On a microcontroller with
//! one flash bank an erase stops the processor for up to half a second, so here the caller decides when one may
//! happen. A handful of numbers needs no keys: a record holds all of them.
//!
//! # Layout
//! Two sectors of 64-byte slots. A slot is erased or holds a record: all parameters, a sequence number and a checksum.
//! The record with the highest number is the current one. The next record goes into the next erased slot of the same
//! sector; when no slot is left, the *other* sector is erased and starts with it. The newest record is therefore never
//! in a sector that is being erased, and after a power loss the old or the new record is intact.
//!
//! # Guarantees
//! [`ParameterStore::open`] returns a complete record or the defaults; [`Restored`] says which. A half-written slot may
//! read differently each time: checksums are verified at every start, and no slot is written twice between erases.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use embedded_storage::nor_flash::NorFlash;
use gleaner_pilot::{Enable, ParameterId, Parameters};

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);
const MAGIC: [u8; 4] = *b"GLNP";
/// Version of the record layout. Parameters are only appended, so a shorter record of this version is accepted.
const VERSION: u16 = 1;
const SECTORS: u32 = 2;
/// Size of a record: a multiple of every flash's write unit.
const SLOT_BYTES: usize = 64;
const VALUES_AT: usize = 12;
const CRC_AT: usize = SLOT_BYTES - 4;
/// Largest number of values in a record.
const VALUES_MAX: usize = (CRC_AT - VALUES_AT) / 4;
const ERASED: u8 = 0xFF;

const _: () = assert!(gleaner_link::PARAMETERS.len() <= VALUES_MAX);

type Slot = [u8; SLOT_BYTES];

/// Result of restoring the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restored {
    /// The flash is erased: the defaults.
    Nothing,
    /// The parameters of the last save.
    Saved,
    /// The parameters of a valid record, but a later record or one of its values is damaged.
    Older,
    /// The flash is not erased and no record is valid: the defaults.
    Damaged,
}

/// Reason why a save failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveError {
    /// A sector must be erased first, and the caller did not allow it. Retry when erasing is allowed.
    Full,
    /// The flash refused, or reads back different bytes.
    Flash,
}

/// The parameters in the first two sectors of a flash.
pub struct ParameterStore<F> {
    flash: F,
    sector: u32,
    /// The next slot to try in that sector.
    slot: u32,
    sequence: u32,
}

impl<F: NorFlash> ParameterStore<F> {
    const SLOTS: u32 = (F::ERASE_SIZE / SLOT_BYTES) as u32;

    /// Finds the newest record. Writes nothing.
    ///
    /// # Cost
    /// One pass over the two sectors.
    pub fn open(flash: F) -> (ParameterStore<F>, Parameters, Restored) {
        const { assert!(F::ERASE_SIZE >= SLOT_BYTES && SLOT_BYTES.is_multiple_of(F::WRITE_SIZE)) };
        // Without a record the last sector counts as full: the first save erases sector 0.
        let mut store = ParameterStore { flash, sector: SECTORS - 1, slot: Self::SLOTS, sequence: 0 };
        let mut newest: Option<(Slot, u32)> = None;
        let mut spoilt = None;
        for sector in 0..SECTORS {
            for slot in 0..Self::SLOTS {
                let Some(bytes) = store.read(sector, slot) else { continue };
                if bytes.iter().all(|&byte| byte == ERASED) {
                    continue;
                }
                match sequence_of(&bytes) {
                    Some(sequence) if newest.is_none_or(|(_, best)| sequence > best) => {
                        newest = Some((bytes, sequence));
                        (store.sector, store.slot, store.sequence) = (sector, slot + 1, sequence);
                    }
                    Some(_) => {}
                    None => spoilt = Some((sector, slot)),
                }
            }
        }
        let Some((record, _)) = newest else {
            let found = if spoilt.is_some() { Restored::Damaged } else { Restored::Nothing };
            return (store, Parameters::default(), found);
        };
        let (parameters, complete) = parameters_of(&record);
        // A damaged slot behind the newest record was a later save; elsewhere it is older and does not matter.
        let later = spoilt.is_some_and(|(sector, slot)| sector == store.sector && slot >= store.slot);
        let found = if complete && !later { Restored::Saved } else { Restored::Older };
        (store, parameters, found)
    }

    /// Saves all parameters; `GLN_ENABLE` is saved as 0. `may_erase` permits erasing a sector, which may stop the
    /// processor meanwhile.
    ///
    /// # Errors
    /// See [`SaveError`]; the previous record stays valid.
    pub fn save(&mut self, parameters: &Parameters, may_erase: bool) -> Result<(), SaveError> {
        let record = record(parameters, self.sequence.wrapping_add(1));
        while self.slot < Self::SLOTS {
            let slot = self.slot;
            self.slot += 1;
            let is_erased =
                self.read(self.sector, slot).is_some_and(|bytes| bytes.iter().all(|&byte| byte == ERASED));
            if is_erased && self.write(self.sector, slot, &record) {
                return Ok(());
            }
        }
        if !may_erase {
            return Err(SaveError::Full);
        }
        let other = (self.sector + 1) % SECTORS;
        let start = other * F::ERASE_SIZE as u32;
        self.flash.erase(start, start + F::ERASE_SIZE as u32).map_err(|_| SaveError::Flash)?;
        if !self.write(other, 0, &record) {
            return Err(SaveError::Flash);
        }
        (self.sector, self.slot) = (other, 1);
        Ok(())
    }

    fn read(&mut self, sector: u32, slot: u32) -> Option<Slot> {
        let mut bytes = [0; SLOT_BYTES];
        self.flash.read(offset::<F>(sector, slot), &mut bytes).ok()?;
        Some(bytes)
    }

    /// Writes a record and reads it back.
    fn write(&mut self, sector: u32, slot: u32, record: &Slot) -> bool {
        let written = self.flash.write(offset::<F>(sector, slot), record).is_ok();
        if written && self.read(sector, slot).as_ref() == Some(record) {
            self.sequence = self.sequence.wrapping_add(1);
            return true;
        }
        false
    }
}

fn offset<F: NorFlash>(sector: u32, slot: u32) -> u32 {
    sector * F::ERASE_SIZE as u32 + slot * SLOT_BYTES as u32
}

fn record(parameters: &Parameters, sequence: u32) -> Slot {
    let mut slot = [0; SLOT_BYTES];
    let count = gleaner_link::PARAMETERS.len() as u16;
    let [version, count, sequence] =
        [&VERSION.to_le_bytes()[..], &count.to_le_bytes(), &sequence.to_le_bytes()];
    let values = gleaner_link::PARAMETERS.iter().flat_map(|spec| {
        let value =
            if spec.id == ParameterId::Enable { Enable::Off.value() } else { parameters.value(spec.id) };
        value.to_le_bytes()
    });
    let header = MAGIC.iter().chain(version).chain(count).chain(sequence).copied();
    for (to, from) in slot.iter_mut().zip(header.chain(values)) {
        *to = from;
    }
    let sum = checksum(&slot);
    for (to, from) in slot.iter_mut().skip(CRC_AT).zip(sum.to_le_bytes()) {
        *to = from;
    }
    slot
}

fn checksum(slot: &Slot) -> u32 {
    CRC.checksum(slot.split_last_chunk::<4>().map_or(&[][..], |(content, _)| content))
}

/// The sequence number of a valid record.
fn sequence_of(slot: &Slot) -> Option<u32> {
    let (header, _) = slot.split_first_chunk::<VALUES_AT>()?;
    let [m0, m1, m2, m3, v0, v1, _, _, s0, s1, s2, s3] = *header;
    let (_, sealed) = slot.split_last_chunk()?;
    let is_whole = [m0, m1, m2, m3] == MAGIC
        && u16::from_le_bytes([v0, v1]) == VERSION
        && u32::from_le_bytes(*sealed) == checksum(slot);
    is_whole.then_some(u32::from_le_bytes([s0, s1, s2, s3]))
}

/// The parameters of a valid record, and whether every value was in range. A value out of range (written by a program
/// with other ranges) becomes the default.
fn parameters_of(slot: &Slot) -> (Parameters, bool) {
    let mut parameters = Parameters::default();
    let mut complete = true;
    let [c0, c1] = [slot.get(6), slot.get(7)].map(|byte| byte.copied().unwrap_or(0));
    let count = usize::from(u16::from_le_bytes([c0, c1]));
    let values = slot.get(VALUES_AT..CRC_AT).unwrap_or(&[]).chunks_exact(4).take(count);
    for (spec, value) in gleaner_link::PARAMETERS.iter().zip(values) {
        let value = value.first_chunk().map_or(f32::NAN, |bytes| f32::from_le_bytes(*bytes));
        complete &= parameters.set_id(spec.id, value).is_ok();
    }
    (parameters, complete)
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::Double;
