//! Postcard in COBS: the format of our own modems.

use super::Format;
use crate::report::{DELIMITER, Report, ReportFault, STUFFED_BYTES, decode_stuffed};
use heapless::Vec;

/// Counters of a radio's bytes, by kind. They stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReportStats {
    /// Bytes received.
    pub bytes: u32,
    /// Reports handed out.
    pub reports: u32,
    /// Frames, lines or datagrams that are not of this format.
    pub framing: u32,
    /// Frames with a wrong checksum, and LoRa uplinks without a correct CRC.
    pub checksum: u32,
    /// Frames of this format that are no report.
    pub malformed: u32,
    /// Copies of a frame that was already reported.
    pub duplicates: u32,
}

impl ReportStats {
    /// Nothing received.
    pub const NONE: ReportStats =
        ReportStats { bytes: 0, reports: 0, framing: 0, checksum: 0, malformed: 0, duplicates: 0 };

    pub(super) fn count_bytes(&mut self, bytes: &[u8]) {
        self.bytes = self.bytes.saturating_add(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
    }
}

/// Finds reports in a stream of bytes. Every zero byte is a new start, so damage affects only the frame that it is
/// in.
#[derive(Clone, Debug, Default)]
pub struct ReportDecoder {
    held: Vec<u8, STUFFED_BYTES>,
    /// The current frame is too long: skip to its end.
    skipping: bool,
    stats: ReportStats,
}

impl ReportDecoder {
    /// A decoder before the first byte.
    #[must_use]
    pub const fn new() -> ReportDecoder {
        ReportDecoder { held: Vec::new(), skipping: false, stats: ReportStats::NONE }
    }

    /// Takes in bytes and hands out every report that ends in them, in order.
    pub fn push(&mut self, bytes: &[u8], mut report: impl FnMut(Report)) {
        self.stats.count_bytes(bytes);
        for &byte in bytes {
            if byte == DELIMITER {
                self.end_frame().into_iter().for_each(&mut report);
            } else if self.held.push(byte).is_err() {
                self.skipping = true;
            }
        }
    }

    /// The counters.
    #[must_use]
    pub const fn stats(&self) -> ReportStats {
        self.stats
    }

    fn end_frame(&mut self) -> Option<Report> {
        if self.held.is_empty() {
            return None;
        }
        let decoded = if self.skipping { Err(ReportFault::Framing) } else { decode_stuffed(&self.held) };
        self.held.clear();
        self.skipping = false;
        let counter = match decoded {
            Ok(_) => &mut self.stats.reports,
            Err(ReportFault::Framing) => &mut self.stats.framing,
            Err(ReportFault::Checksum) => &mut self.stats.checksum,
            Err(ReportFault::Malformed) => &mut self.stats.malformed,
        };
        *counter = counter.saturating_add(1);
        decoded.ok()
    }
}

impl Format for ReportDecoder {
    fn receive(&mut self, bytes: &[u8], report: &mut dyn FnMut(Report), _: &mut dyn FnMut(&[u8])) {
        self.push(bytes, report);
    }

    fn stats(&self) -> ReportStats {
        self.stats
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode;
    use gleaner_units::Db;
    use proptest::prelude::*;

    fn any_report() -> impl Strategy<Value = Report> {
        (any::<u32>(), -50.0f32..50.0, proptest::option::of(0.0f32..1e6), any::<u32>())
            .prop_map(|(device, snr, remaining, age_ms)| Report { device, snr: Db(snr), remaining, age_ms })
    }

    fn decode_all(decoder: &mut ReportDecoder, bytes: &[u8]) -> std::vec::Vec<Report> {
        let mut reports = std::vec::Vec::new();
        decoder.push(bytes, |report| reports.push(report));
        reports
    }

    #[test]
    fn each_kind_of_damage_has_its_counter() {
        let report = Report { device: 7, snr: Db(-3.0), remaining: None, age_ms: 5 };
        let mut decoder = ReportDecoder::new();
        let mut damaged = encode(&report);
        damaged[2] ^= 0x10;
        assert!(decode_all(&mut decoder, &damaged).is_empty());
        assert!(decode_all(&mut decoder, &[0xFF; 40]).is_empty());
        assert_eq!(decode_all(&mut decoder, &encode(&report)), [report]);
        let stats = decoder.stats();
        assert_eq!((stats.reports, stats.framing, stats.checksum, stats.malformed), (1, 1, 1, 0));
        assert_eq!(stats.bytes as usize, damaged.len() + 40 + encode(&report).len());
    }

    proptest! {
        #![proptest_config(crate::seeded())]

        #[test]
        fn no_garbage_and_no_split_costs_a_report(
            items in proptest::collection::vec((any_report(), proptest::collection::vec(any::<u8>(), 0..60)), 1..12),
            split in 1usize..30,
        ) {
            let mut wire = std::vec::Vec::new();
            for (report, garbage) in &items {
                wire.extend_from_slice(garbage);
                wire.extend_from_slice(&encode(report));
            }
            let mut decoder = ReportDecoder::new();
            let decoded: std::vec::Vec<Report> =
                wire.chunks(split).flat_map(|chunk| decode_all(&mut decoder, chunk)).collect();
            // Garbage that passes the checksum by chance would be extra; none may be missing or out of order.
            let mut rest = decoded.iter();
            for (report, _) in &items {
                prop_assert!(rest.any(|found| found == report));
            }
        }

        #[test]
        fn arbitrary_bytes_do_not_panic(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
            let mut decoder = ReportDecoder::new();
            let reports = decode_all(&mut decoder, &bytes).len();
            prop_assert_eq!(decoder.stats().reports as usize, reports);
            let _ = crate::decode_body(&bytes);
        }

        #[test]
        fn a_flipped_bit_is_never_a_wrong_report(report in any_report(), byte in 1usize..21, bit in 0u8..8) {
            let mut frame = encode(&report);
            let last = frame.len() - 2;
            frame[byte.min(last)] ^= 1 << bit;
            for decoded in decode_all(&mut ReportDecoder::new(), &frame) {
                prop_assert_eq!(decoded, report);
            }
        }
    }
}
