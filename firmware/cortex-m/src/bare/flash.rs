//! What stands in flash beside the program: the mission and the model, each in sectors of its own.
#![allow(unsafe_code)]

use embedded_storage::nor_flash::{NorFlashError, NorFlashErrorKind};
use gleaner_policy::native::Aligned;

unsafe extern "C" {
    /// Where the parameters' sectors begin and end, from the memory map.
    static _parameters_start: u8;
    static _parameters_end: u8;
}

/// The flash does not do what it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refused;

impl NorFlashError for Refused {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// The word of the parameters' sectors at `offset`, a multiple of four.
///
/// # Errors
/// It is not inside.
pub fn parameter_place(offset: u32) -> Result<*mut u32, Refused> {
    let start = (&raw const _parameters_start).cast_mut();
    let room = (&raw const _parameters_end).addr() - start.addr();
    let offset = offset as usize;
    let is_inside = offset.is_multiple_of(4) && offset.checked_add(4).is_some_and(|end| end <= room);
    if is_inside { Ok(start.wrapping_add(offset).cast()) } else { Err(Refused) }
}

/// Reads bytes of the parameters' sectors, from `offset`, a multiple of four.
///
/// # Errors
/// They are not all inside.
pub fn parameter_bytes(offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
    for (index, four) in bytes.chunks_mut(4).enumerate() {
        let place = parameter_place(offset.wrapping_add(index as u32 * 4))?;
        // SAFETY: a word inside the sectors, which are always readable; volatile, because flash changes under the
        // compiler's feet.
        let word = unsafe { place.read_volatile() };
        for (to, from) in four.iter_mut().zip(word.to_le_bytes()) {
            *to = from;
        }
    }
    Ok(())
}

/// Room for a mission image.
const MISSION_BYTES: usize = 4096;

// SAFETY: a section of flash that the memory map keeps for it.
#[unsafe(link_section = ".gleaner_mission")]
#[used]
static MISSION: [u8; MISSION_BYTES] = padded(include_bytes!(concat!(env!("OUT_DIR"), "/mission.bin")));

// SAFETY: as above.
#[unsafe(link_section = ".gleaner_model")]
#[used]
static MODEL: Aligned<[u8; include_bytes!("../../../../models/gleaner.gln").len()]> =
    Aligned(*include_bytes!("../../../../models/gleaner.gln"));

const fn padded<const N: usize>(image: &[u8; N]) -> [u8; MISSION_BYTES] {
    let mut bytes = [0xFF; MISSION_BYTES];
    let (room, _) = bytes.split_at_mut(N);
    room.copy_from_slice(image);
    bytes
}

/// The mission image as it stands in flash now, which may be another than the program was built with: the black box
/// keeps the compiler from knowing the bytes of the build.
pub fn mission() -> &'static [u8] {
    core::hint::black_box(&MISSION)
}

/// The model as it stands in flash now.
pub fn model() -> &'static [u8] {
    &core::hint::black_box(&MODEL).0
}
