//! GPIO ports (RM0090, chapter 8; RM0433, chapter 11): the registers are the same in both families.
#![allow(unsafe_code)]

use core::convert::Infallible;
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

const MODER: usize = 0;
const PUPDR: usize = 3;
const IDR: usize = 4;
const BSRR: usize = 6;
const AFRL: usize = 8;

const INPUT: u32 = 0;
const OUTPUT: u32 = 1;
const ALTERNATE: u32 = 2;
const PULL_UP: u32 = 1;

/// A port of 16 pins whose clock is enabled.
#[derive(Clone, Copy)]
pub struct Gpio {
    registers: *mut u32,
}

impl Gpio {
    /// The port with these registers.
    ///
    /// # Safety
    /// `registers` is the base address of a GPIO port, and nothing else changes the pins that are configured here.
    #[must_use]
    pub const unsafe fn new(registers: *const ()) -> Gpio {
        Gpio { registers: registers.cast_mut().cast() }
    }

    /// Gives a pin to a peripheral.
    pub fn alternate(self, pin: u32, function: u32) {
        self.set_field(AFRL + pin as usize / 8, 4 * (pin % 8), 0xF, function);
        self.set_field(MODER, 2 * pin, 3, ALTERNATE);
    }

    /// Turns on a pin's pull-up.
    pub fn pull_up(self, pin: u32) {
        self.set_field(PUPDR, 2 * pin, 3, PULL_UP);
    }

    /// Makes a pin an input with a pull-up.
    #[must_use]
    pub fn input(self, pin: u32) -> Input {
        self.pull_up(pin);
        self.set_field(MODER, 2 * pin, 3, INPUT);
        Input { port: self, pin }
    }

    /// Makes a pin a push-pull output.
    #[must_use]
    pub fn output(self, pin: u32) -> Output {
        self.set_field(MODER, 2 * pin, 3, OUTPUT);
        Output { port: self, pin }
    }

    fn set_field(self, register: usize, shift: u32, mask: u32, value: u32) {
        let place = self.registers.wrapping_add(register);
        // SAFETY: a register of the port; pins are configured before anything else runs.
        unsafe { place.write_volatile(place.read_volatile() & !(mask << shift) | value << shift) };
    }
}

/// An input pin.
pub struct Input {
    port: Gpio,
    pin: u32,
}

impl ErrorType for Input {
    type Error = Infallible;
}

impl InputPin for Input {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        // SAFETY: reading the input register has no side effect.
        let levels = unsafe { self.port.registers.wrapping_add(IDR).read_volatile() };
        Ok(levels >> self.pin & 1 == 1)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

/// An output pin.
pub struct Output {
    port: Gpio,
    pin: u32,
}

impl ErrorType for Output {
    type Error = Infallible;
}

impl OutputPin for Output {
    fn set_low(&mut self) -> Result<(), Infallible> {
        // SAFETY: the set/reset register changes this pin only, in one write.
        unsafe { self.port.registers.wrapping_add(BSRR).write_volatile(1 << (self.pin + 16)) };
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        // SAFETY: as above.
        unsafe { self.port.registers.wrapping_add(BSRR).write_volatile(1 << self.pin) };
        Ok(())
    }
}
