//! Telemetry logs: for each frame the time in microseconds since 1970 as eight big-endian bytes, then the frame.

/// The frames of a telemetry log with their times. It ends at the first byte that begins no frame, as where a full disk
/// left a part of one.
pub fn telemetry_frames(mut log: &[u8]) -> impl Iterator<Item = (u64, &[u8])> {
    std::iter::from_fn(move || {
        let (time, rest) = log.split_first_chunk::<8>()?;
        let length = frame_length(rest)?;
        let frame = rest.get(..length)?;
        log = rest.get(length..)?;
        Some((u64::from_be_bytes(*time), frame))
    })
}

/// MAVLink guide, "Packet Serialization": header, payload, checksum, and 13 bytes of a signature where flag 1 is set.
fn frame_length(bytes: &[u8]) -> Option<usize> {
    match *bytes {
        [0xFD, payload, flags, ..] => Some(12 + usize::from(payload) + if flags & 1 == 1 { 13 } else { 0 }),
        [0xFE, payload, ..] => Some(8 + usize::from(payload)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_all_forms_are_found_and_half_a_frame_ends_the_log() {
        let mut log = Vec::new();
        let mut write = |time: u64, frame: &[u8]| {
            log.extend_from_slice(&time.to_be_bytes());
            log.extend_from_slice(frame);
        };
        let (v2, v1) = ([0xFD, 1, 0, 9, 9, 9, 9, 9, 9, 9, 7, 5, 5], [0xFE, 2, 9, 9, 9, 9, 7, 7, 5, 5]);
        let mut signed = vec![0xFD, 1, 1];
        signed.resize(26, 3);
        write(1, &v2);
        write(2, &v1);
        write(3, &signed);
        write(4, &v2[..8]);
        let found: Vec<_> = telemetry_frames(&log).collect();
        assert_eq!(found, [(1, &v2[..]), (2, &v1[..]), (3, &signed[..])]);
    }
}
