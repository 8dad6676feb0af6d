//! Arbitrary bytes as a mission image, also behind a valid checksum: nothing panics, and an accepted mission
//! survives writing and reading.

use gleaner_pilot::mission_image;

/// Magic, version, length, checksum: see the table in `mission_image`.
const HEADER_BYTES: usize = 12;

pub fn run(data: &[u8]) {
    decode(data);
    let mut sealed = data.to_vec();
    let Some(body) = data.get(HEADER_BYTES..) else { return };
    let length = u16::try_from(body.len()).unwrap_or(u16::MAX);
    let body = &body[..usize::from(length)];
    let version = &data[4..6];
    sealed[..4].copy_from_slice(b"GLNM");
    sealed[6..8].copy_from_slice(&length.to_le_bytes());
    sealed[8..HEADER_BYTES].copy_from_slice(&crc32(&[version, body].concat()).to_le_bytes());
    decode(&sealed);
}

fn decode(bytes: &[u8]) {
    let Ok(mission) = mission_image::decode(bytes) else { return };
    // The machine checks a mission before it takes it.
    let _ = mission.check();
    // As bytes: a number that the check refuses may be NaN.
    let written = mission_image::encode(&mission);
    let again = mission_image::decode(&written).map(|mission| mission_image::encode(&mission));
    assert_eq!(again.as_ref(), Ok(&written));
}

/// CRC-32 (ISO-HDLC), by the definition.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}
