//! The three serial lines: pins, speeds, interrupts.
use cortex_m::peripheral::NVIC;
use gleaner_cortex_m::bare::{LINK, LINK_BAUD, LOG, LOG_BAUD, RADIO, RADIO_BAUD};
use gleaner_cortex_m::{LineFault, Uart};
use stm32h7::stm32h743::{Interrupt, Peripherals, UART4, USART2, USART3, interrupt, usart1::RegisterBlock};

const ENABLE: u32 = 1;
const RECEIVE: u32 = 1 << 2;
const TRANSMIT: u32 = 1 << 3;
const CALL_WHEN_RECEIVED: u32 = 1 << 5;
const CALL_WHEN_ROOM: u32 = 1 << 7;
/// RM0433, 48.8.8: frame error, noise, overrun.
const FAULTS: u32 = 0b1110;
const OVERRUN: u32 = 1 << 3;
const RECEIVED: u32 = 1 << 5;
const ROOM: u32 = 1 << 7;

/// Gives the pins to the UARTs, starts them.
pub fn start(chip: &Peripherals, bus_hz: u32) {
    chip.RCC.ahb4enr().modify(|_, w| w.gpioaen().set_bit().gpioben().set_bit().gpiocen().set_bit());
    chip.RCC.apb1lenr().modify(|_, w| w.usart2en().set_bit().usart3en().set_bit().uart4en().set_bit());
    // Alternate function 7 on PA2, PA3, PB10, PB11; 8 on PC10. After a reset the pins are analogue (mode 3), so mode
    // 2 clears the lower bit. Inputs are pulled up, so that an open line is silent.
    chip.GPIOA.afrl().modify(|r, w| unsafe { w.bits(r.bits() | 0x7700) });
    chip.GPIOA.pupdr().modify(|r, w| unsafe { w.bits(r.bits() | 1 << 6) });
    chip.GPIOA.moder().modify(|r, w| unsafe { w.bits(r.bits() & !(1 << 4 | 1 << 6)) });
    chip.GPIOB.afrh().modify(|r, w| unsafe { w.bits(r.bits() | 0x7700) });
    chip.GPIOB.pupdr().modify(|r, w| unsafe { w.bits(r.bits() | 1 << 22) });
    chip.GPIOB.moder().modify(|r, w| unsafe { w.bits(r.bits() & !(1 << 20 | 1 << 22)) });
    chip.GPIOC.afrh().modify(|r, w| unsafe { w.bits(r.bits() | 0x800) });
    chip.GPIOC.moder().modify(|r, w| unsafe { w.bits(r.bits() & !(1 << 20)) });
    let both = ENABLE | RECEIVE | TRANSMIT | CALL_WHEN_RECEIVED;
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
        // SAFETY: the handlers below are ready, and nothing is guarded by these interrupts being off.
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
        // SAFETY: after `start` only this line's interrupt touches the registers (and the end of the program, after
        // which nothing else runs).
        unsafe { &*self.0 }
    }
}

impl Uart for Line {
    fn take(&mut self) -> Option<Result<u8, LineFault>> {
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

    fn give(&mut self, byte: u8) {
        self.registers().tdr().write(|w| unsafe { w.bits(byte.into()) });
    }

    fn call_for_more(&mut self, on: bool) {
        let room = if on { CALL_WHEN_ROOM } else { 0 };
        self.registers().cr1().modify(|r, w| unsafe { w.bits(r.bits() & !CALL_WHEN_ROOM | room) });
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

/// Stops all transmitters: a fault ends the stream of setpoints before anything else.
#[unsafe(no_mangle)]
fn gleaner_silence() {
    for line in [USART2::ptr(), USART3::ptr(), UART4::ptr()] {
        Line(line).registers().cr1().reset();
    }
}
