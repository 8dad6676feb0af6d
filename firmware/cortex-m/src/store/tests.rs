//! The store over a double that is stricter than flash.

use super::*;
use embedded_storage::nor_flash::{ErrorType, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use std::cell::RefCell;
use std::rc::Rc;
use std::vec::Vec;

const SECTOR: usize = 4 * SLOT_BYTES;
const WORD: usize = 4;

/// Flash that accepts each word once between erases, erases one sector at a time, and can lose power during any
/// operation. It outlives the store.
#[derive(Default)]
struct Chip {
    bytes: Vec<u8>,
    written: Vec<bool>,
    /// Operations until power is lost, in the middle of the last one.
    power_for: Option<usize>,
    operations: usize,
    noise: u32,
}

#[derive(Clone)]
pub(crate) struct Double(Rc<RefCell<Chip>>);

#[derive(Debug, PartialEq)]
pub(crate) struct PowerLost;

impl NorFlashError for PowerLost {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Chip {
    fn random(&mut self) -> u8 {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.noise >> 24) as u8
    }

    /// `Ok(true)`: complete; `Ok(false)`: interrupted; `Err`: no power.
    fn operate(&mut self) -> Result<bool, PowerLost> {
        self.operations += 1;
        match &mut self.power_for {
            Some(0) => Err(PowerLost),
            Some(left) => {
                *left -= 1;
                Ok(*left > 0)
            }
            None => Ok(true),
        }
    }
}

impl Double {
    pub(crate) fn new() -> Double {
        let bytes = std::vec![0xFF; 2 * SECTOR];
        let written = std::vec![false; 2 * SECTOR / WORD];
        Double(Rc::new(RefCell::new(Chip { bytes, written, noise: 1, ..Chip::default() })))
    }

    /// Operations so far, complete or not.
    pub(crate) fn operations(&self) -> usize {
        self.0.borrow().operations
    }

    pub(crate) fn power_for(&self, operations: Option<usize>) {
        self.0.borrow_mut().power_for = operations;
    }
}

impl ErrorType for Double {
    type Error = PowerLost;
}

impl ReadNorFlash for Double {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerLost> {
        let chip = self.0.borrow();
        bytes.copy_from_slice(&chip.bytes[offset as usize..offset as usize + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR
    }
}

impl NorFlash for Double {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerLost> {
        let (from, to) = (from as usize, to as usize);
        assert!(from % SECTOR == 0 && to == from + SECTOR && to <= 2 * SECTOR, "one sector at a time");
        let mut chip = self.0.borrow_mut();
        let whole = chip.operate()?;
        for at in from..to {
            // An interrupted erase leaves old bytes, erased bytes or a mixture.
            chip.bytes[at] = match chip.random() % 3 {
                _ if whole => 0xFF,
                0 => 0xFF,
                1 => chip.bytes[at],
                _ => chip.bytes[at] | chip.random(),
            };
            chip.written[at / WORD] = !whole;
        }
        if whole { Ok(()) } else { Err(PowerLost) }
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerLost> {
        assert!((offset as usize).is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD), "whole words");
        let mut chip = self.0.borrow_mut();
        for (index, word) in bytes.chunks(WORD).enumerate() {
            let at = offset as usize + index * WORD;
            assert!(!chip.written[at / WORD], "a word is written once between erases");
            let whole = chip.operate()?;
            chip.written[at / WORD] = true;
            for (byte, &value) in (at..).zip(word) {
                let mask = if whole { value } else { value | chip.random() };
                chip.bytes[byte] &= mask;
            }
            if !whole {
                return Err(PowerLost);
            }
        }
        Ok(())
    }
}

fn with_speed(speed: f32) -> Parameters {
    let mut parameters = Parameters::default();
    parameters.set_id(ParameterId::Speed, speed).unwrap();
    parameters
}

fn speed(parameters: &Parameters) -> f32 {
    parameters.speed().0
}

#[test]
fn the_last_save_is_restored_through_many_erases() {
    let double = Double::new();
    let (_, parameters, found) = ParameterStore::open(double.clone());
    assert_eq!((parameters, found), (Parameters::default(), Restored::Nothing));
    for round in 0..40_u8 {
        let (mut store, _, _) = ParameterStore::open(double.clone());
        let mut saved = with_speed(1.0 + f32::from(round % 19));
        saved.set_id(ParameterId::Enable, 1.0).unwrap();
        assert_eq!(store.save(&saved, true), Ok(()));
        saved.set_id(ParameterId::Enable, 0.0).unwrap();
        let (_, parameters, found) = ParameterStore::open(double.clone());
        assert_eq!((parameters, found), (saved, Restored::Saved), "round {round}: all but GLN_ENABLE");
    }
}

#[test]
fn without_permission_nothing_is_erased_or_lost() {
    let double = Double::new();
    let (mut store, _, _) = ParameterStore::open(double.clone());
    assert_eq!(store.save(&with_speed(2.0), false), Err(SaveError::Full), "the first save erases");
    for speed in [2.0, 3.0, 4.0, 5.0] {
        assert_eq!(store.save(&with_speed(speed), true), Ok(()));
    }
    assert_eq!(store.save(&with_speed(6.0), false), Err(SaveError::Full));
    assert_eq!(speed(&ParameterStore::open(double.clone()).1), 5.0);
    assert_eq!(store.save(&with_speed(6.0), true), Ok(()));
    assert_eq!(speed(&ParameterStore::open(double).1), 6.0);
}

#[test]
fn power_may_be_lost_during_any_operation() {
    let run = |power_for: Option<usize>| {
        let double = Double::new();
        let mut before = speed(&Parameters::default());
        let mut cut = false;
        for round in 0..13_u8 {
            let wanted = 1.0 + f32::from(round);
            if !cut {
                double.power_for(power_for.map(|left| left.saturating_sub(double.0.borrow().operations)));
            }
            let (mut store, parameters, found) = ParameterStore::open(double.clone());
            assert_eq!(speed(&parameters), before, "power for {power_for:?}, round {round}, {found:?}");
            if store.save(&with_speed(wanted), true).is_ok() {
                before = wanted;
                continue;
            }
            assert!(!cut, "only once");
            cut = true;
            double.power_for(None);
            // Power is back: the old value or the new one, intact.
            let (mut store, parameters, found) = ParameterStore::open(double.clone());
            assert!(
                [before, wanted].contains(&speed(&parameters)),
                "power for {power_for:?}: {parameters:?}"
            );
            assert!(found != Restored::Damaged || before == speed(&Parameters::default()));
            assert_eq!(store.save(&with_speed(wanted), true), Ok(()), "the next save succeeds");
            before = wanted;
        }
        (double.0.borrow().operations, cut)
    };
    let (operations, _) = run(None);
    assert!(operations > 13 * 16, "{operations}");
    for power_for in 1..=operations {
        assert!(run(Some(power_for)).1, "cut after {power_for}");
    }
}

#[test]
fn a_corrupted_record_falls_back_to_the_one_before() {
    let zeros = Double::new();
    zeros.0.borrow_mut().bytes.fill(0);
    let (mut store, parameters, found) = ParameterStore::open(zeros.clone());
    assert_eq!((parameters, found), (Parameters::default(), Restored::Damaged));
    assert_eq!(store.save(&with_speed(7.0), true), Ok(()));
    assert_eq!(speed(&ParameterStore::open(zeros).1), 7.0);

    // Any flipped bit of the newest record restores the one before.
    for bit in 0..SLOT_BYTES * 8 {
        let double = Double::new();
        let (mut store, _, _) = ParameterStore::open(double.clone());
        assert_eq!(store.save(&with_speed(3.0), true), Ok(()));
        assert_eq!(store.save(&with_speed(4.0), true), Ok(()));
        double.0.borrow_mut().bytes[SLOT_BYTES + bit / 8] ^= 1 << (bit % 8);
        let (_, parameters, found) = ParameterStore::open(double);
        assert_eq!((speed(&parameters), found), (3.0, Restored::Older), "bit {bit}");
    }
}

#[test]
fn a_value_out_of_range_becomes_the_default() {
    let mut slot = record(&with_speed(9.0), 1);
    slot[VALUES_AT + 4 * 2..][..4].copy_from_slice(&1e9_f32.to_le_bytes());
    let sum = checksum(&slot);
    slot[CRC_AT..].copy_from_slice(&sum.to_le_bytes());
    assert_eq!(sequence_of(&slot), Some(1));
    let (parameters, complete) = parameters_of(&slot);
    assert_eq!((parameters.altitude().0, speed(&parameters), complete), (60.0, 9.0, false));
}
