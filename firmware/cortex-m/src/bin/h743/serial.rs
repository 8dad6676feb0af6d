//! The three serial lines: pins, baud rates, interrupts.

use cortex_m::peripheral::NVIC;
use gleaner_cortex_m::bare::stm32::{Gpio, give_line_pins};
use gleaner_cortex_m::bare::{LINK, LINK_BAUD, LOG, LOG_BAUD, RADIO, RADIO_BAUD};
use gleaner_cortex_m::{LineFault, Uart};
use stm32h7::stm32h743::{
    GPIOA, GPIOB, GPIOC, Interrupt, Peripherals, UART4, USART2, USART3, interrupt, usart1::RegisterBlock,
};

const ENABLE: u32 = 1;
const RECEIVE: u32 = 1 << 2;
const TRANSMIT: u32 = 1 << 3;
const INTERRUPT_ON_RECEIVED: u32 = 1 << 5;
const INTERRUPT_ON_ROOM: u32 = 1 << 7;
/// RM0433, 48.8.8: frame error, noise, overrun.
const FAULTS: u32 = 0b1110;
const OVERRUN: u32 = 1 << 3;
const RECEIVED: u32 = 1 << 5;
const ROOM: u32 = 1 << 7;

/// Gives the pins to the UARTs and starts them.
pub fn start(chip: &Peripherals, bus_hz: u32) {
    chip.RCC.ahb4enr().modify(|_, w| w.gpioaen().set_bit().gpioben().set_bit().gpiocen().set_bit());
    chip.RCC.apb1lenr().modify(|_, w| w.usart2en().set_bit().usart3en().set_bit().uart4en().set_bit());
    // SAFETY: ports whose clocks are enabled; nothing else uses these pins.
    give_line_pins(unsafe {
        [Gpio::new(GPIOA::ptr().cast()), Gpio::new(GPIOB::ptr().cast()), Gpio::new(GPIOC::ptr().cast())]
    });
    let both = ENABLE | RECEIVE | TRANSMIT | INTERRUPT_ON_RECEIVED;
    let lines: [(&RegisterBlock, u32, u32); 3] = [
        (&chip.USART2, LINK_BAUD, both),
        (&chip.USART3, RADIO_BAUD, both),
        (&chip.UART4, LOG_BAUD, ENABLE | TRANSMIT),
    ];
    for (registers, baud, control) in lines {
        registers.brr().write(|w| unsafe { w.bits(((bus_hz + baud / 2) / baud) as _) });
        registers.cr1().write(|w| unsafe { w.bits(control) });
    }
    for interrupt in [Interrupt::USART2, Interrupt::USART3, Interrupt::UART4] {
        // SAFETY: the handlers below are ready, and no critical section relies on these interrupts being masked.
        unsafe { NVIC::unmask(interrupt) };
    }
}

#[unsafe(no_mangle)]
fn gleaner_wake_link() {
    NVIC::pend(Interrupt::USART2);
}

#[unsafe(no_mangle)]
fn gleaner_wake_log() {
    NVIC::pend(Interrupt::UART4);
}

/// One UART.
struct Line(*const RegisterBlock);

impl Line {
    fn registers(&self) -> &RegisterBlock {
        // SAFETY: after `start` only this line's interrupt uses the registers, and the end of the program.
        unsafe { &*self.0 }
    }
}

impl Uart for Line {
    fn receive(&mut self) -> Option<Result<u8, LineFault>> {
        let status = self.registers().isr().read().bits();
        if status & (RECEIVED | FAULTS) == 0 {
            return None;
        }
        self.registers().icr().write(|w| unsafe { w.bits(status & FAULTS) });
        let byte = if status & RECEIVED != 0 { self.registers().rdr().read().bits() as u8 } else { 0 };
        Some(match status & FAULTS {
            0 => Ok(byte),
            faults if faults & OVERRUN != 0 => Err(LineFault::Overrun),
            _ => Err(LineFault::Line),
        })
    }

    fn has_room(&mut self) -> bool {
        self.registers().isr().read().bits() & ROOM != 0
    }

    fn transmit(&mut self, byte: u8) {
        self.registers().tdr().write(|w| unsafe { w.bits(byte.into()) });
    }

    fn interrupt_when_empty(&mut self, on: bool) {
        let room = if on { INTERRUPT_ON_ROOM } else { 0 };
        self.registers().cr1().modify(|r, w| unsafe { w.bits(r.bits() & !INTERRUPT_ON_ROOM | room) });
    }
}

#[interrupt]
fn USART2() {
    LINK.serve(&mut Line(stm32h7::stm32h743::USART2::ptr()));
}

#[interrupt]
fn USART3() {
    RADIO.serve(&mut Line(stm32h7::stm32h743::USART3::ptr()));
}

#[interrupt]
fn UART4() {
    LOG.serve(&mut Line(stm32h7::stm32h743::UART4::ptr()));
}

/// Stops all transmitters: after a fault, no further setpoint is sent.
#[unsafe(no_mangle)]
fn gleaner_stop_transmitters() {
    for line in [USART2::ptr(), USART3::ptr(), UART4::ptr()] {
        Line(line).registers().cr1().reset();
    }
}
