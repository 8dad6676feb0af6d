//! One report and its bytes.

use crc::{CRC_16_IBM_SDLC, Crc};
use gleaner_units::Db;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// A measurement of one device. Decoding does not check the numbers: [`crate::DeviceTable::apply`] does, once for
/// all formats.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The device's id.
    pub device: u32,
    /// Signal to noise ratio of the device's transmission.
    pub snr: Db,
    /// Data units that the device still holds, if known.
    pub remaining: Option<f32>,
    /// Time from the measurement to the sending of the report, ms.
    pub age_ms: u32,
}

/// Why bytes were refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportFault {
    /// Not COBS, or too short for a checksum.
    Framing,
    /// Wrong checksum.
    Checksum,
    /// Not the bytes of one report.
    Malformed,
}

/// Longest body: 5 + 4 + 5 + 5.
pub const BODY_BYTES: usize = 19;
const CRC_BYTES: usize = 2;
/// Body and checksum, one byte of COBS overhead.
pub(crate) const STUFFED_BYTES: usize = BODY_BYTES + CRC_BYTES + 1;
pub(crate) const DELIMITER: u8 = 0;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_SDLC);

/// One frame with both its delimiters.
pub type FrameBytes = Vec<u8, { STUFFED_BYTES + 2 }>;

/// The body alone, the payload of a MAVLink `TUNNEL`.
#[must_use]
pub fn encode_body(report: &Report) -> Vec<u8, BODY_BYTES> {
    let mut bytes = [0; BODY_BYTES];
    // The array has room for the longest body, so this never fails.
    let used = postcard::to_slice(report, &mut bytes).map_or(0, |used| used.len());
    Vec::from_slice(bytes.get(..used).unwrap_or(&[])).unwrap_or_default()
}

/// One frame for the serial port.
#[must_use]
pub fn encode(report: &Report) -> FrameBytes {
    let mut plain: Vec<u8, { BODY_BYTES + CRC_BYTES }> = Vec::new();
    let body = encode_body(report);
    let checksum = CRC.checksum(&body).to_le_bytes();
    let mut stuffed = [0; STUFFED_BYTES];
    // The types have room for the longest frame, so nothing is cut off here.
    for byte in body.into_iter().chain(checksum) {
        let _ = plain.push(byte);
    }
    let used = cobs::try_encode(&plain, &mut stuffed).unwrap_or(0);
    let mut frame = FrameBytes::new();
    for byte in [DELIMITER].into_iter().chain(stuffed.into_iter().take(used)).chain([DELIMITER]) {
        let _ = frame.push(byte);
    }
    frame
}

/// Reads the body alone.
///
/// # Errors
/// [`ReportFault::Malformed`].
pub fn decode_body(body: &[u8]) -> Result<Report, ReportFault> {
    let (report, rest) = postcard::take_from_bytes::<Report>(body).map_err(|_| ReportFault::Malformed)?;
    if rest.is_empty() { Ok(report) } else { Err(ReportFault::Malformed) }
}

/// Reads the bytes between two delimiters.
pub(crate) fn decode_stuffed(stuffed: &[u8]) -> Result<Report, ReportFault> {
    let mut plain = [0; STUFFED_BYTES];
    let used = cobs::decode(stuffed, &mut plain).map_err(|_| ReportFault::Framing)?;
    let plain = plain.get(..used).unwrap_or(&[]);
    let (body, checksum) = plain.split_last_chunk::<CRC_BYTES>().ok_or(ReportFault::Framing)?;
    if CRC.checksum(body) != u16::from_le_bytes(*checksum) {
        return Err(ReportFault::Checksum);
    }
    decode_body(body)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_has_its_check_value() {
        assert_eq!(CRC.checksum(b"123456789"), 0x906E);
    }

    #[test]
    fn the_longest_report_fits() {
        let longest = Report { device: u32::MAX, snr: Db(-1.1), remaining: Some(1.1), age_ms: u32::MAX };
        assert_eq!(encode_body(&longest).len(), BODY_BYTES);
        assert_eq!(decode_body(&encode_body(&longest)), Ok(longest));
        assert_eq!(encode(&longest).len(), STUFFED_BYTES + 2);
    }

    #[test]
    fn two_bodies_and_none_are_malformed() {
        let good = Report { device: 1, snr: Db(0.0), remaining: None, age_ms: 0 };
        let mut two = encode_body(&good).to_vec();
        two.extend_from_slice(&encode_body(&good));
        assert_eq!(decode_body(&two), Err(ReportFault::Malformed));
        assert_eq!(decode_body(&[]), Err(ReportFault::Malformed));
    }
}
