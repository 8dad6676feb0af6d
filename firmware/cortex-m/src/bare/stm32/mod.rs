//! Peripherals that are the same in the STM32 families of our boards: GPIO and the independent watchdog.

mod gpio;
pub mod watchdog;

pub use gpio::{Gpio, Input, Output};
