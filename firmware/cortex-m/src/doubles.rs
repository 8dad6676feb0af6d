//! Doubles of `embedded-hal` pins and delays and of a flash controller. They panic where hardware would hide a mistake.

use crate::FlashController;
use core::cell::{Cell, RefCell};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{Error, ErrorKind, ErrorType, InputPin, OutputPin, PinState};
use std::rc::Rc;
use std::vec::Vec;

/// The pin cannot be used.
#[derive(Debug)]
pub(crate) struct Broken;

impl Error for Broken {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

/// An input with a level that the test sets; `None` cannot be read.
#[derive(Clone)]
pub(crate) struct Input(Rc<Cell<Option<PinState>>>);

impl Input {
    pub(crate) fn new(level: Option<PinState>) -> Input {
        Input(Rc::new(Cell::new(level)))
    }

    pub(crate) fn set(&self, level: Option<PinState>) {
        self.0.set(level);
    }
}

impl ErrorType for Input {
    type Error = Broken;
}

impl InputPin for Input {
    fn is_high(&mut self) -> Result<bool, Broken> {
        self.0.get().map(|level| level == PinState::High).ok_or(Broken)
    }

    fn is_low(&mut self) -> Result<bool, Broken> {
        self.is_high().map(|high| !high)
    }
}

/// An output that records what is written and panics when the same level is written twice in a row.
#[derive(Clone)]
pub(crate) struct Output(Rc<(RefCell<Vec<PinState>>, Cell<bool>)>);

impl Output {
    pub(crate) fn new() -> Output {
        Output(Rc::new((RefCell::new(Vec::new()), Cell::new(false))))
    }

    pub(crate) fn written(&self) -> Vec<PinState> {
        self.0.0.borrow().clone()
    }

    pub(crate) fn fail(&self, fails: bool) {
        self.0.1.set(fails);
    }
}

impl ErrorType for Output {
    type Error = Broken;
}

impl OutputPin for Output {
    fn set_low(&mut self) -> Result<(), Broken> {
        self.set_state(PinState::Low)
    }

    fn set_high(&mut self) -> Result<(), Broken> {
        self.set_state(PinState::High)
    }

    fn set_state(&mut self, level: PinState) -> Result<(), Broken> {
        if self.0.1.get() {
            return Err(Broken);
        }
        let mut written = self.0.0.borrow_mut();
        assert_ne!(written.last(), Some(&level), "written twice");
        written.push(level);
        Ok(())
    }
}

/// A delay that adds up and panics at one that the decision loop cannot afford.
#[derive(Clone)]
pub(crate) struct Delay(Rc<Cell<u32>>);

impl Delay {
    pub(crate) fn new() -> Delay {
        Delay(Rc::new(Cell::new(0)))
    }

    pub(crate) fn total_us(&self) -> u32 {
        self.0.get()
    }
}

impl DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        assert!(ns <= 1_000_000, "a single delay of {ns} ns");
        self.0.set(self.0.get() + ns / 1000);
    }
}

/// Bytes of a sector of [`Controller`].
pub(crate) const SECTOR: usize = 64;
const UNIT: usize = 8;

/// A controller that panics where hardware would fault or ignore the request.
pub(crate) struct Controller {
    pub(crate) bytes: Vec<u8>,
    pub(crate) unlocked: bool,
    /// Reads of the busy flag until an operation ends; `None` never.
    pub(crate) takes: Option<u32>,
    pub(crate) busy: Cell<Option<u32>>,
    pub(crate) accepts: bool,
    pub(crate) fails: bool,
    pub(crate) locks: u32,
}

impl Controller {
    pub(crate) fn new() -> Controller {
        Controller {
            bytes: std::vec![0xFF; 2 * SECTOR],
            unlocked: false,
            takes: Some(3),
            busy: Cell::new(Some(0)),
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
