//! A lock-free byte queue between an interrupt and the program.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

/// Holds up to `N` bytes; `N` is a power of two. One writer and one reader may use it at the same time.
///
/// `written` and `read` count all bytes since the start and wrap; their difference is the number of bytes held. Only
/// the writer stores `written` and only the reader stores `read`, each after it has accessed the byte.
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    written: AtomicU32,
    read: AtomicU32,
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Ring<N> {
        Ring::new()
    }
}

impl<const N: usize> Ring<N> {
    /// An empty ring.
    #[must_use]
    pub const fn new() -> Ring<N> {
        const { assert!(N.is_power_of_two() && N <= 1 << 16) };
        Ring { bytes: [const { AtomicU8::new(0) }; N], written: AtomicU32::new(0), read: AtomicU32::new(0) }
    }

    /// Number of bytes held.
    #[must_use]
    pub fn held(&self) -> usize {
        self.written.load(Ordering::Acquire).wrapping_sub(self.read.load(Ordering::Acquire)) as usize
    }

    /// Number of bytes that fit.
    #[must_use]
    pub fn room(&self) -> usize {
        N.saturating_sub(self.held())
    }

    /// Appends a byte; returns false when the ring is full. For the writer only.
    pub fn push(&self, byte: u8) -> bool {
        let at = self.written.load(Ordering::Relaxed);
        if self.room() == 0 {
            return false;
        }
        if let Some(slot) = self.bytes.get(at as usize & (N - 1)) {
            slot.store(byte, Ordering::Relaxed);
        }
        self.written.store(at.wrapping_add(1), Ordering::Release);
        true
    }

    /// Removes the oldest byte. For the reader only.
    pub fn pop(&self) -> Option<u8> {
        if self.held() == 0 {
            return None;
        }
        let at = self.read.load(Ordering::Relaxed);
        let byte = self.bytes.get(at as usize & (N - 1)).map(|slot| slot.load(Ordering::Relaxed));
        self.read.store(at.wrapping_add(1), Ordering::Release);
        byte
    }

    /// Removes bytes into `buffer`; returns their number.
    pub fn pop_into(&self, buffer: &mut [u8]) -> usize {
        let mut taken = 0;
        for slot in buffer {
            let Some(byte) = self.pop() else { break };
            *slot = byte;
            taken += 1;
        }
        taken
    }

    /// Appends as many bytes as fit; returns their number.
    pub fn push_from(&self, bytes: &[u8]) -> usize {
        bytes.iter().take_while(|&&byte| self.push(byte)).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    #[test]
    fn bytes_come_out_in_order_and_room_is_exact() {
        let ring = Ring::<8>::new();
        let mut next_in = 0u8;
        let mut next_out = 0u8;
        for round in 0..1000 {
            let room = ring.room();
            let taken = ring.push_from(&core::array::from_fn::<u8, 12, _>(|i| next_in.wrapping_add(i as u8)));
            assert_eq!(taken, room);
            assert!(!ring.push(0), "full");
            next_in = next_in.wrapping_add(taken as u8);
            let mut out = [0; 8];
            let count = ring.pop_into(&mut out[..1 + round % 8]);
            for byte in &out[..count] {
                assert_eq!(*byte, next_out);
                next_out = next_out.wrapping_add(1);
            }
        }
    }

    #[test]
    fn positions_wrap() {
        let ring = Ring::<4>::new();
        ring.written.store(u32::MAX - 1, Ordering::Relaxed);
        ring.read.store(u32::MAX - 1, Ordering::Relaxed);
        assert_eq!(ring.push_from(&[1, 2, 3, 4, 5]), 4);
        assert_eq!((ring.held(), ring.room()), (4, 0));
        let mut out = [0; 4];
        assert_eq!(ring.pop_into(&mut out), 4);
        assert_eq!((out, ring.pop()), ([1, 2, 3, 4], None));
    }

    #[test]
    fn a_writer_and_a_reader_on_two_cores_lose_nothing() {
        static RING: Ring<64> = Ring::new();
        const COUNT: usize = 200_000;
        let writer = thread::spawn(|| {
            for index in 0..COUNT {
                while !RING.push(index as u8) {
                    thread::yield_now();
                }
            }
        });
        for index in 0..COUNT {
            let byte = loop {
                match RING.pop() {
                    Some(byte) => break byte,
                    None => thread::yield_now(),
                }
            };
            assert_eq!(byte, index as u8);
        }
        writer.join().unwrap();
    }
}
