//! The parameters' flash over a controller that is stricter than hardware.

use super::*;
use crate::doubles::{Controller, Delay, SECTOR};
use std::vec::Vec;

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
