//! A serial line: two byte rings, one interrupt handler and two counters.

use crate::Ring;
use core::convert::Infallible;
use core::sync::atomic::{AtomicU32, Ordering};
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};

/// What can be wrong with a received byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineFault {
    /// A byte was lost before this one: the receiver was not read in time.
    Overrun,
    /// Framing error or noise: wrong baud rate, bad wiring, or the other end restarts. The byte is discarded.
    Line,
}

/// The registers of one UART that its interrupt handler needs. An implementation must access nothing else.
pub trait Uart {
    /// Reads the receiver: a byte, a fault, or nothing.
    fn receive(&mut self) -> Option<Result<u8, LineFault>>;
    /// Whether the transmitter can accept a byte.
    fn has_room(&mut self) -> bool;
    /// Writes a byte to the transmitter. Called only after `has_room` returned true.
    fn transmit(&mut self, byte: u8);
    /// Enables or disables the interrupt for an empty transmitter.
    fn interrupt_when_empty(&mut self, on: bool);
}

/// Counters of a port since boot. They saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortStats {
    /// Received bytes lost because the interrupt or the program was late.
    pub lost: u32,
    /// Bytes received with an error.
    pub damaged: u32,
}

/// A serial line. It is a `static`, so that its interrupt handler can reach it.
pub struct Port<const IN: usize, const OUT: usize> {
    incoming: Ring<IN>,
    outgoing: Ring<OUT>,
    lost: AtomicU32,
    damaged: AtomicU32,
}

impl<const IN: usize, const OUT: usize> Default for Port<IN, OUT> {
    fn default() -> Port<IN, OUT> {
        Port::new()
    }
}

impl<const IN: usize, const OUT: usize> Port<IN, OUT> {
    /// Most bytes that one interrupt moves in each direction: a UART that reports data forever must not block the
    /// program.
    const PER_INTERRUPT: usize = 32;

    /// A port with empty rings.
    #[must_use]
    pub const fn new() -> Port<IN, OUT> {
        Port {
            incoming: Ring::new(),
            outgoing: Ring::new(),
            lost: AtomicU32::new(0),
            damaged: AtomicU32::new(0),
        }
    }

    /// The interrupt handler: moves bytes between the rings and the UART. Only the port's own interrupt may call it.
    ///
    /// # Cost
    /// At most 32 bytes in each direction, about 20 instructions per byte.
    pub fn serve(&self, uart: &mut impl Uart) {
        for _ in 0..Port::<IN, OUT>::PER_INTERRUPT {
            match uart.receive() {
                Some(Ok(byte)) => {
                    if !self.incoming.push(byte) {
                        count(&self.lost);
                    }
                }
                Some(Err(LineFault::Overrun)) => count(&self.lost),
                Some(Err(LineFault::Line)) => count(&self.damaged),
                None => break,
            }
        }
        for _ in 0..Port::<IN, OUT>::PER_INTERRUPT {
            if !uart.has_room() {
                break;
            }
            match self.outgoing.pop() {
                Some(byte) => uart.transmit(byte),
                None => break,
            }
        }
        uart.interrupt_when_empty(self.outgoing.held() > 0);
    }

    /// The counters.
    #[must_use]
    pub fn stats(&self) -> PortStats {
        PortStats { lost: self.lost.load(Ordering::Relaxed), damaged: self.damaged.load(Ordering::Relaxed) }
    }

    /// The outgoing ring, for a writer that needs all of its bytes accepted or none.
    #[must_use]
    pub const fn outgoing(&self) -> &Ring<OUT> {
        &self.outgoing
    }
}

/// Saturating increment. Interrupts are the only writers, so load and store need not be one operation.
fn count(counter: &AtomicU32) {
    counter.store(counter.load(Ordering::Relaxed).saturating_add(1), Ordering::Relaxed);
}

/// The program's end of a port. Nothing blocks when `read_ready` and `write_ready` are checked first.
pub struct Endpoint<'p, const IN: usize, const OUT: usize> {
    port: &'p Port<IN, OUT>,
    /// Sets the port's interrupt pending.
    wake: fn(),
}

impl<'p, const IN: usize, const OUT: usize> Endpoint<'p, IN, OUT> {
    /// The program's end of `port`; `wake` sets its interrupt pending.
    #[must_use]
    pub const fn new(port: &'p Port<IN, OUT>, wake: fn()) -> Endpoint<'p, IN, OUT> {
        Endpoint { port, wake }
    }
}

impl<const IN: usize, const OUT: usize> ErrorType for Endpoint<'_, IN, OUT> {
    type Error = Infallible;
}

impl<const IN: usize, const OUT: usize> ReadReady for Endpoint<'_, IN, OUT> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.port.incoming.held() > 0)
    }
}

impl<const IN: usize, const OUT: usize> Read for Endpoint<'_, IN, OUT> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            let taken = self.port.incoming.pop_into(buffer);
            if taken > 0 {
                return Ok(taken);
            }
        }
    }
}

impl<const IN: usize, const OUT: usize> WriteReady for Endpoint<'_, IN, OUT> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.port.outgoing.room() > 0)
    }
}

impl<const IN: usize, const OUT: usize> Write for Endpoint<'_, IN, OUT> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        if bytes.is_empty() {
            return Ok(0);
        }
        loop {
            let taken = self.port.outgoing.push_from(bytes);
            (self.wake)();
            if taken > 0 {
                return Ok(taken);
            }
        }
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        while self.port.outgoing.held() > 0 {
            (self.wake)();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;
    use std::vec::Vec;

    /// A UART whose receiver holds a script and whose transmitter has room for a few bytes.
    #[derive(Default)]
    struct Double {
        arrives: VecDeque<Result<u8, LineFault>>,
        room: usize,
        sent: Vec<u8>,
        interrupts: bool,
    }

    impl Uart for Double {
        fn receive(&mut self) -> Option<Result<u8, LineFault>> {
            self.arrives.pop_front()
        }
        fn has_room(&mut self) -> bool {
            self.room > 0
        }
        fn transmit(&mut self, byte: u8) {
            assert!(self.room > 0, "a byte without room is lost");
            self.room -= 1;
            self.sent.push(byte);
        }
        fn interrupt_when_empty(&mut self, on: bool) {
            self.interrupts = on;
        }
    }

    #[test]
    fn bytes_and_faults_arrive_and_are_counted() {
        let port = Port::<4, 4>::new();
        let mut endpoint = Endpoint::new(&port, || {});
        let mut uart = Double::default();
        uart.arrives.extend([
            Ok(1),
            Err(LineFault::Line),
            Ok(2),
            Err(LineFault::Overrun),
            Ok(3),
            Ok(4),
            Ok(5),
        ]);
        assert_eq!(endpoint.read_ready(), Ok(false));
        port.serve(&mut uart);
        assert_eq!(port.stats(), PortStats { lost: 2, damaged: 1 });
        let mut buffer = [0; 8];
        assert_eq!(endpoint.read_ready(), Ok(true));
        assert_eq!(endpoint.read(&mut buffer), Ok(4));
        assert_eq!(buffer[..4], [1, 2, 3, 4]);
    }

    #[test]
    fn a_flood_ends_one_interrupt_after_32_bytes() {
        let port = Port::<64, 4>::new();
        let mut uart = Double::default();
        uart.arrives.extend((0..100).map(Ok));
        port.serve(&mut uart);
        assert_eq!(uart.arrives.len(), 68);
    }

    #[test]
    fn the_transmit_interrupt_is_on_until_the_ring_is_empty() {
        let port = Port::<4, 8>::new();
        let mut endpoint = Endpoint::new(&port, || {});
        assert_eq!(endpoint.write(&[1, 2, 3, 4, 5]), Ok(5));
        let mut uart = Double { room: 2, ..Double::default() };
        port.serve(&mut uart);
        assert_eq!((uart.sent.as_slice(), uart.interrupts), (&[1, 2][..], true));
        uart.room = 10;
        port.serve(&mut uart);
        assert_eq!((uart.sent.as_slice(), uart.interrupts), (&[1, 2, 3, 4, 5][..], false));
        assert_eq!(endpoint.write(&[0; 20]), Ok(8));
        assert_eq!(endpoint.write_ready(), Ok(false));
    }
}
