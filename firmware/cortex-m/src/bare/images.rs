//! The mission and the model, which are in flash sectors of their own beside the program.
#![allow(unsafe_code)]

use gleaner_policy::native::Aligned;

/// Size of the mission's section.
const MISSION_BYTES: usize = 4096;

// SAFETY: a flash section that the memory map reserves for it.
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
    let (start, _) = bytes.split_at_mut(N);
    start.copy_from_slice(image);
    bytes
}

/// The mission image that is in flash now. It may differ from the one the program was built with, so the black box
/// keeps the compiler from assuming those bytes.
pub fn mission() -> &'static [u8] {
    core::hint::black_box(&MISSION)
}

/// The model that is in flash now.
pub fn model() -> &'static [u8] {
    &core::hint::black_box(&MODEL).0
}
