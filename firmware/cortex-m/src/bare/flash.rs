//! What stands in flash beside the program: the mission and the model, each in sectors of its own.
#![allow(unsafe_code)]

use gleaner_policy::native::Aligned;

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
