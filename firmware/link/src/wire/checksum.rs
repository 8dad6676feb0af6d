//! Checksum of a packet: CRC-16/MCRF4XX over everything behind the magic byte, then over the message's `CRC_EXTRA` (MAVLink
//! guide, "Packet Serialization").

use crc::{CRC_16_MCRF4XX, Crc, Table};

/// A host has room for sixteen tables, which take in sixteen bytes at once; the board gets one.
#[cfg(not(target_os = "none"))]
type Tables = Table<16>;
#[cfg(target_os = "none")]
type Tables = Table<1>;

static CRC: Crc<u16, Tables> = Crc::<u16, Tables>::new(&CRC_16_MCRF4XX);

/// The checksum of a packet without its magic byte.
#[must_use]
pub fn checksum(body: &[u8], extra_crc: u8) -> u16 {
    let mut digest = CRC.digest();
    digest.update(body);
    digest.update(&[extra_crc]);
    digest.finalize()
}

/// The `CRC_EXTRA` with which a packet without its magic byte has this checksum.
pub(crate) fn extra_crc(body: &[u8], checksum: u16) -> Option<u8> {
    let mut digest = CRC.digest();
    digest.update(body);
    (0..=u8::MAX).find(|&extra| {
        let mut digest = digest.clone();
        digest.update(&[extra]);
        digest.finalize() == checksum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mavlink_crate_computes_the_same() {
        let bytes: std::vec::Vec<u8> = (0..300_u32).map(|at| (at * 97 % 251) as u8).collect();
        for length in 0..bytes.len() {
            let (body, extra) = (&bytes[..length], bytes[length]);
            assert_eq!(checksum(body, extra), mavlink::calculate_crc(body, extra), "{length} bytes");
            assert_eq!(extra_crc(body, checksum(body, extra)), Some(extra));
        }
    }
}
