//! The three serial lines: pins, baud rates, interrupts.

use cortex_m::peripheral::NVIC;
use gleaner_cortex_m::bare::stm32::{Gpio, give_line_pins};
use gleaner_cortex_m::bare::{LINK, LINK_BAUD, LOG, LOG_BAUD, RADIO, RADIO_BAUD};
use gleaner_cortex_m::{LineFault, Uart};
use stm32f4::stm32f405::{GPIOA, GPIOB, GPIOC, Interrupt, Peripherals, UART4, USART2, USART3, interrupt};

/// Gives the pins to the UARTs and starts them.
pub fn start(chip: &Peripherals, apb1_hz: u32) {
    chip.RCC.ahb1enr().modify(|_, w| w.gpioaen().set_bit().gpioben().set_bit().gpiocen().set_bit());
    chip.RCC.apb1enr().modify(|_, w| w.usart2en().set_bit().usart3en().set_bit().uart4en().set_bit());
    // SAFETY: ports whose clocks are enabled; nothing else uses these pins.
    give_line_pins(unsafe {
        [Gpio::new(GPIOA::ptr().cast()), Gpio::new(GPIOB::ptr().cast()), Gpio::new(GPIOC::ptr().cast())]
    });

    chip.USART2.brr().write(|w| unsafe { w.bits(divider(apb1_hz, LINK_BAUD)) });
    chip.USART2.cr1().write(|w| w.ue().set_bit().te().set_bit().re().set_bit().rxneie().set_bit());
    chip.USART3.brr().write(|w| unsafe { w.bits(divider(apb1_hz, RADIO_BAUD)) });
    chip.USART3.cr1().write(|w| w.ue().set_bit().te().set_bit().re().set_bit().rxneie().set_bit());
    chip.UART4.brr().write(|w| unsafe { w.bits(divider(apb1_hz, LOG_BAUD)) });
    chip.UART4.cr1().write(|w| w.ue().set_bit().te().set_bit());
    for interrupt in [Interrupt::USART2, Interrupt::USART3, Interrupt::UART4] {
        // SAFETY: the handlers below are ready, and no critical section relies on these interrupts being masked.
        unsafe { NVIC::unmask(interrupt) };
    }
}

/// RM0090, 30.3.4, with 16 samples a bit: the register holds the divider in sixteenths. Rounded.
const fn divider(bus_hz: u32, baud: u32) -> u16 {
    ((bus_hz + baud / 2) / baud) as u16
}

#[unsafe(no_mangle)]
fn gleaner_wake_link() {
    NVIC::pend(Interrupt::USART2);
}

#[unsafe(no_mangle)]
fn gleaner_wake_log() {
    NVIC::pend(Interrupt::UART4);
}

/// USARTs and UARTs have the same registers but different types.
macro_rules! uart {
    ($name:ident, $registers:ty) => {
        struct $name;

        impl $name {
            fn registers(&self) -> &'static <$registers as core::ops::Deref>::Target {
                // SAFETY: after `start` only this line's interrupt uses the registers, and the end of the program.
                unsafe { &*<$registers>::ptr() }
            }
        }

        impl Uart for $name {
            /// RM0090, 30.6.1: reading the status and then the data clears both the flags and the fault.
            fn receive(&mut self) -> Option<Result<u8, LineFault>> {
                let status = self.registers().sr().read();
                let fault = status.ore().bit() || status.fe().bit() || status.nf().bit();
                if !fault && status.rxne().bit_is_clear() {
                    return None;
                }
                let byte = self.registers().dr().read().bits() as u8;
                Some(match (status.ore().bit(), fault) {
                    (true, _) => Err(LineFault::Overrun),
                    (false, true) => Err(LineFault::Line),
                    (false, false) => Ok(byte),
                })
            }

            fn has_room(&mut self) -> bool {
                self.registers().sr().read().txe().bit_is_set()
            }

            fn transmit(&mut self, byte: u8) {
                self.registers().dr().write(|w| unsafe { w.bits(byte.into()) });
            }

            fn interrupt_when_empty(&mut self, on: bool) {
                self.registers().cr1().modify(|_, w| w.txeie().bit(on));
            }
        }
    };
}

uart!(LinkUart, USART2);
uart!(RadioUart, USART3);
uart!(LogUart, UART4);

#[interrupt]
fn USART2() {
    LINK.serve(&mut LinkUart);
}

#[interrupt]
fn USART3() {
    RADIO.serve(&mut RadioUart);
}

#[interrupt]
fn UART4() {
    LOG.serve(&mut LogUart);
}

/// Stops all transmitters: after a fault, no further setpoint is sent.
#[unsafe(no_mangle)]
fn gleaner_stop_transmitters() {
    LinkUart.registers().cr1().reset();
    RadioUart.registers().cr1().reset();
    LogUart.registers().cr1().reset();
}
