//! Where the parameters' sectors are, from the memory map.
#![allow(unsafe_code)]

unsafe extern "C" {
    static _parameters_start: u8;
    static _parameters_end: u8;
}

/// The word of the parameters' sectors at `offset`, a multiple of four; `None` when it is outside.
#[must_use]
pub fn parameter_place(offset: u32) -> Option<*mut u32> {
    let start = (&raw const _parameters_start).cast_mut();
    let size = (&raw const _parameters_end).addr() - start.addr();
    let offset = offset as usize;
    let is_inside = offset.is_multiple_of(4) && offset.checked_add(4).is_some_and(|end| end <= size);
    is_inside.then(|| start.wrapping_add(offset).cast())
}

/// Reads bytes from `offset`, a multiple of four. Bytes outside the sectors read as erased.
pub fn parameter_bytes(offset: u32, bytes: &mut [u8]) {
    for (index, four) in bytes.chunks_mut(4).enumerate() {
        // SAFETY: a word inside the sectors, which are always readable. Volatile, because erasing and writing change
        // flash without the compiler's knowledge.
        let word = parameter_place(offset.wrapping_add(index as u32 * 4))
            .map_or(u32::MAX, |place| unsafe { place.read_volatile() });
        for (to, from) in four.iter_mut().zip(word.to_le_bytes()) {
            *to = from;
        }
    }
}
