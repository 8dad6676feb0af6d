//! Random draws without a panic path.

use rand_core::Rng;

/// Draws that the search needs, from any generator.
pub(crate) trait Draw {
    /// A number below `end`; 0 if `end` is 0. The bias is below `end / 2^32`.
    fn below(&mut self, end: usize) -> usize;

    /// A number in `[0, 1)` with 24 random bits.
    fn unit(&mut self) -> f32;

    /// True in half of the draws.
    fn coin(&mut self) -> bool;

    /// A number in `-by..=by`.
    fn offset(&mut self, by: i16) -> i16;
}

impl<R: Rng + ?Sized> Draw for R {
    fn below(&mut self, end: usize) -> usize {
        ((u64::from(self.next_u32()) * end as u64) >> 32) as usize
    }

    fn unit(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    fn coin(&mut self) -> bool {
        self.next_u32() >> 31 == 1
    }

    fn offset(&mut self, by: i16) -> i16 {
        self.below(2 * usize::from(by.unsigned_abs()) + 1) as i16 - by
    }
}
