//! Arbitrary bytes as a model of the native engine: nothing panics, also behind a valid checksum, and whatever is
//! accepted can be asked.

use gleaner_policy::native::{AlignedBytes, Model, NativePolicy, Workspace};
use gleaner_policy::{LOCAL_MAP_CELLS, Policy, Tokens};

/// Bytes of the checksum at the end.
const CRC_BYTES: usize = 4;

pub fn run(data: &[u8]) {
    read(data);
    if let Some(content) = data.len().checked_sub(CRC_BYTES).and_then(|end| data.get(..end)) {
        read(&[content, &crc32(content).to_le_bytes()].concat());
    }
}

fn read(bytes: &[u8]) {
    let aligned = AlignedBytes::new(bytes);
    let Ok(model) = Model::read(aligned.as_slice()) else { return };
    assert!(model.goldens().all(|golden| golden.tokens.devices.len() <= gleaner_policy::K_MAX));
    let tokens = Tokens {
        uav: [20.0, 40.0, 100.0, -100.0],
        preference: [0.5; 2],
        local_map: (0..LOCAL_MAP_CELLS).map(|_| 0.0).collect(),
        devices: [[20.0, -40.0, 6_000.0, 5.0, 1.0, 0.0, 0.0]].into_iter().collect(),
    };
    let mut workspace = Box::<Workspace>::default();
    // Damaged weights may give an answer that is not finite, which is an error and no panic.
    let _ = NativePolicy::new(model, &mut workspace).infer(&tokens);
}

/// CRC-32 (ISO-HDLC), by the definition.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}
