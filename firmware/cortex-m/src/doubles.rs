//! Doubles of `embedded-hal` pins and delays. They panic where hardware would hide a mistake.

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

/// An output that remembers what was written and panics when the same level is written twice in a row.
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
