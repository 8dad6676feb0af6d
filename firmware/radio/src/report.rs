//! One report and its bytes.

use crc::{CRC_16_IBM_SDLC, Crc};
use gleaner_units::Db;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// What the modem measured of one device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The device's id.
    pub device: u32,
    /// Signal to noise ratio of the device's transmission.
    pub snr: Db,
    /// Data units that the device still holds, if it tells.
    pub remaining: Option<f32>,
    /// How long before the report was sent it was measured, ms.
    pub age_ms: u32,
}

/// Why bytes were refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportFault {
    /// Not COBS, or too short for a checksum.
    Framing,
    /// Wrong checksum.
    Checksum,
    /// Not the bytes of a report, or more than one.
    Malformed,
    /// An SNR that is NaN or infinite, or a remaining amount that is that or negative.
    Value,
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

/// The body alone, as it travels inside a MAVLink `TUNNEL`.
#[must_use]
pub fn encode_body(report: &Report) -> Vec<u8, BODY_BYTES> {
    let mut bytes = [0; BODY_BYTES];
    // The array is as long as the longest body, so this never fails.
    let used = postcard::to_slice(report, &mut bytes).map_or(0, |used| used.len());
    Vec::from_slice(bytes.get(..used).unwrap_or(&[])).unwrap_or_default()
}

/// One whole frame for the serial port.
#[must_use]
pub fn encode(report: &Report) -> FrameBytes {
    let mut plain: Vec<u8, { BODY_BYTES + CRC_BYTES }> = Vec::new();
    let body = encode_body(report);
    let checksum = CRC.checksum(&body).to_le_bytes();
    let mut stuffed = [0; STUFFED_BYTES];
    // The types are as long as the longest frame, so nothing is cut off here.
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
/// [`ReportFault::Malformed`] or [`ReportFault::Value`].
pub fn decode_body(body: &[u8]) -> Result<Report, ReportFault> {
    let (report, rest) = postcard::take_from_bytes::<Report>(body).map_err(|_| ReportFault::Malformed)?;
    if !rest.is_empty() {
        return Err(ReportFault::Malformed);
    }
    let remaining_allowed = report.remaining.is_none_or(|units| units.is_finite() && units >= 0.0);
    if !report.snr.0.is_finite() || !remaining_allowed {
        return Err(ReportFault::Value);
    }
    Ok(report)
}

/// Reads what stood between two delimiters.
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
    fn the_checksum_is_the_one_that_the_page_names() {
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
    fn values_that_are_no_values_are_refused() {
        let good = Report { device: 1, snr: Db(0.0), remaining: None, age_ms: 0 };
        for snr in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let body = encode_body(&Report { snr: Db(snr), ..good });
            assert_eq!(decode_body(&body), Err(ReportFault::Value), "{snr}");
        }
        for remaining in [f32::NAN, f32::INFINITY, -0.5] {
            let body = encode_body(&Report { remaining: Some(remaining), ..good });
            assert_eq!(decode_body(&body), Err(ReportFault::Value), "{remaining}");
        }
        let mut two = encode_body(&good).to_vec();
        two.extend_from_slice(&encode_body(&good));
        assert_eq!(decode_body(&two), Err(ReportFault::Malformed));
        assert_eq!(decode_body(&[]), Err(ReportFault::Malformed));
    }
}
