//! Peripherals and pins that are the same in the STM32 families of our boards: GPIO, pins of the serial lines, independent
//! watchdog.

mod gpio;
mod line_pins;
pub mod watchdog;

pub use gpio::{Gpio, Input, Output};
pub use line_pins::give_line_pins;
