//! The parameters' flash over a controller that is stricter than hardware.

use super::*;
use crate::doubles::Delay;
use std::vec::Vec;

const SECTOR: usize = 64;
const UNIT: usize = 8;

/// A controller that panics where hardware would fault or ignore the request.
struct Controller {
    bytes: Vec<u8>,
    unlocked: bool,
    /// Looks at the busy flag until an operation ends; `None` never.
    takes: Option<u32>,
    busy: std::cell::Cell<Option<u32>>,
    accepts: bool,
    fails: bool,
    locks: u32,
}

impl Controller {
    fn new() -> Controller {
        Controller {
            bytes: std::vec![0xFF; 2 * SECTOR],
            unlocked: false,
            takes: Some(3),
            busy: std::cell::Cell::new(Some(0)),
            accepts: true,
            fails: false,
            locks: 0,
        }
    }

    fn start(&mut self) -> bool {
        assert!(self.unlocked, "an operation on a locked controller is a bus fault");
        assert_eq!(self.busy.get(), Some(0), "an operation while another one runs");
        if self.accepts {
            self.busy.set(self.takes);
        }
        self.accepts
    }
}

impl FlashController for Controller {
    const SECTOR_BYTES: usize = SECTOR;
    const WRITE_BYTES: usize = UNIT;
    const OPERATION_LIMIT_MS: u32 = 20;

    fn read(&self, offset: u32, bytes: &mut [u8]) {
        assert!(offset.is_multiple_of(4) && bytes.len().is_multiple_of(4), "whole words");
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
    }

    fn unlock(&mut self) {
        assert!(!self.unlocked, "two unlock sequences lock the controller until the next reset");
        self.unlocked = true;
    }

    fn start_erase(&mut self, sector: u32) -> bool {
        let accepted = self.start();
        if accepted {
            self.bytes[sector as usize * SECTOR..][..SECTOR].fill(0xFF);
        }
        accepted
    }

    fn start_write(&mut self, offset: u32, unit: &[u8]) -> bool {
        assert!(offset.is_multiple_of(UNIT as u32) && unit.len() == UNIT);
        let accepted = self.start();
        if accepted {
            let place = &mut self.bytes[offset as usize..][..UNIT];
            assert!(place.iter().all(|&byte| byte == 0xFF), "a unit is written once between erases");
            place.copy_from_slice(unit);
        }
        accepted
    }

    fn is_busy(&self) -> bool {
        let Some(left) = self.busy.get() else { return true };
        self.busy.set(Some(left.saturating_sub(1)));
        left > 0
    }

    fn has_failed(&self) -> bool {
        assert_eq!(self.busy.get(), Some(0), "the error flags are valid after the operation only");
        self.fails
    }

    fn lock(&mut self) {
        self.unlocked = false;
        self.locks += 1;
    }
}

fn flash(controller: Controller) -> (ParameterFlash<Controller, Delay>, Delay) {
    let delay = Delay::new();
    (ParameterFlash::new(controller, delay.clone()), delay)
}

#[test]
fn units_are_written_and_sectors_erased_one_by_one() {
    let (mut flash, delay) = flash(Controller::new());
    let written: Vec<u8> = (0..24).collect();
    assert_eq!(flash.write(SECTOR as u32, &written), Ok(()));
    let mut read = [0; 24];
    assert_eq!(flash.read(SECTOR as u32, &mut read), Ok(()));
    assert_eq!(read[..], written[..]);
    assert_eq!(flash.erase(0, 2 * SECTOR as u32), Ok(()));
    assert!(flash.controller.bytes.iter().all(|&byte| byte == 0xFF));
    assert_eq!((flash.controller.locks, flash.controller.unlocked), (5, false));
    assert_eq!(delay.total_us(), 5 * 3 * POLL_US);
}

#[test]
fn nothing_outside_the_sectors_is_touched() {
    let (mut flash, _) = flash(Controller::new());
    let size = 2 * SECTOR as u32;
    for (offset, count) in [(size, 8), (size - 8, 16), (4, 8), (0, 12), (u32::MAX - 7, 8)] {
        assert_eq!(flash.write(offset, &std::vec![0; count]), Err(FlashError::Range), "{offset}, {count}");
    }
    for (from, to) in [(0, size + 64), (8, 64), (64, 0), (size, u32::MAX)] {
        assert_eq!(flash.erase(from, to), Err(FlashError::Range), "{from}..{to}");
    }
    assert_eq!(flash.read(size - 4, &mut [0; 8]), Err(FlashError::Range));
    assert_eq!(flash.controller.locks, 0);
}

#[test]
fn refusals_and_failures_end_locked() {
    for spoil in [|c: &mut Controller| c.accepts = false, |c: &mut Controller| c.fails = true] {
        let mut controller = Controller::new();
        spoil(&mut controller);
        let (mut flash, _) = flash(controller);
        assert_eq!(flash.write(0, &[0; 16]), Err(FlashError::Refused));
        assert_eq!((flash.controller.locks, flash.controller.unlocked), (1, false), "stops at the first one");
        assert_eq!(flash.erase(0, SECTOR as u32), Err(FlashError::Refused));
    }
}

#[test]
fn a_controller_that_stays_busy_is_given_up_after_its_limit() {
    let (mut flash, delay) = flash(Controller { takes: None, ..Controller::new() });
    assert_eq!(flash.erase(0, SECTOR as u32), Err(FlashError::Refused));
    assert!((20_000..20_100).contains(&delay.total_us()), "{}", delay.total_us());
    assert!(!flash.controller.unlocked);
}
