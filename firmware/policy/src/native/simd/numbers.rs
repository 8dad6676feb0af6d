//! Storage aligned to cache lines.

/// Bytes of a cache line, and of the widest register.
const LINE_BYTES: usize = 64;
const SPARE: usize = LINE_BYTES / size_of::<f32>();

/// Numbers that begin at a cache line, so that no vector load crosses two.
pub(super) struct Numbers {
    storage: Vec<f32>,
    /// Index of the first number. The storage never moves.
    begin: usize,
    length: usize,
}

impl Numbers {
    pub fn zeros(length: usize) -> Numbers {
        let storage = vec![0.0; length + SPARE];
        let begin = storage.as_ptr().align_offset(LINE_BYTES).min(SPARE);
        Numbers { storage, begin, length }
    }

    pub fn all(&self) -> &[f32] {
        self.first(self.length)
    }

    pub fn all_mut(&mut self) -> &mut [f32] {
        self.first_mut(self.length)
    }

    /// The first `length` numbers.
    #[inline(always)]
    pub fn first(&self, length: usize) -> &[f32] {
        self.storage.get(self.begin..self.begin + length).unwrap_or_default()
    }

    /// The first `length` numbers.
    #[inline(always)]
    pub fn first_mut(&mut self, length: usize) -> &mut [f32] {
        self.storage.get_mut(self.begin..self.begin + length).unwrap_or_default()
    }
}
