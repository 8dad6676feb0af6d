//! Storage with the alignment of a blob.

#[cfg(feature = "std")]
use zerocopy::IntoBytes;

/// Bytes at a multiple of four, the alignment that [`super::Model::read`] requires:
/// `static BLOB: &Aligned<[u8]> = &Aligned(*include_bytes!("model.gln"));`
#[derive(Clone, Copy, Debug)]
#[repr(C, align(4))]
pub struct Aligned<T: ?Sized>(pub T);

/// A copy of bytes at a multiple of four, for programs that read a file.
#[cfg(feature = "std")]
#[derive(Clone, Debug)]
pub struct AlignedBytes {
    words: Vec<u32>,
    length: usize,
}

#[cfg(feature = "std")]
impl AlignedBytes {
    /// Copies `bytes`.
    #[must_use]
    pub fn new(bytes: &[u8]) -> AlignedBytes {
        let mut words = vec![0_u32; bytes.len().div_ceil(size_of::<u32>())];
        for (to, from) in words.as_mut_bytes().iter_mut().zip(bytes) {
            *to = *from;
        }
        AlignedBytes { words, length: bytes.len() }
    }

    /// The bytes.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.words.as_bytes().get(..self.length).unwrap_or_default()
    }
}
