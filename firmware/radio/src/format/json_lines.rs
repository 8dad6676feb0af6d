//! One JSON object per line or datagram: `{"id":1,"snr_db":2.5,"remaining":1000,"age_s":0.2}`.
//!
//! `id` is a number or eight hexadecimal digits; `dev_addr` (8 digits) or `dev_eui` (16 digits, of which the last 8
//! count) may stand in its place. `remaining` and `age_s` may be absent. Other keys are ignored.

use super::{Calibration, Format, ReportStats};
use crate::Report;
use gleaner_units::Db;
use serde::Deserialize;
use std::vec::Vec;

/// Longest line, bytes.
const LINE_BYTES: usize = 1024;

#[derive(Deserialize)]
struct Line {
    id: Option<Id>,
    dev_addr: Option<Id>,
    dev_eui: Option<Id>,
    snr_db: f32,
    remaining: Option<f32>,
    #[serde(default)]
    age_s: f32,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Id {
    Number(u32),
    Text(std::string::String),
}

impl Id {
    fn number(&self) -> Option<u32> {
        match self {
            Id::Number(number) => Some(*number),
            Id::Text(text) if matches!(text.len(), 8 | 16) => {
                u64::from_str_radix(text, 16).ok().map(|number| number as u32)
            }
            Id::Text(_) => None,
        }
    }
}

impl Line {
    fn report(&self, calibration: Calibration) -> Option<Report> {
        let device = [&self.id, &self.dev_addr, &self.dev_eui].into_iter().flatten().next()?.number()?;
        let known = self.age_s.is_finite() && self.age_s >= 0.0;
        let age_ms = known.then_some((self.age_s * 1e3) as u32)?;
        Some(Report { device, snr: calibration.apply(Db(self.snr_db)), remaining: self.remaining, age_ms })
    }
}

/// Reads JSON lines.
#[derive(Clone, Debug, Default)]
pub struct JsonLines {
    calibration: Calibration,
    held: Vec<u8>,
    skipping: bool,
    stats: ReportStats,
}

impl JsonLines {
    /// Reads reports whose SNR is to be calibrated.
    #[must_use]
    pub fn new(calibration: Calibration) -> JsonLines {
        JsonLines { calibration, ..JsonLines::default() }
    }

    /// Reads the held line. Returns false if it is not JSON.
    fn end_line(&mut self, report: &mut dyn FnMut(Report)) -> bool {
        let text = self.held.trim_ascii();
        if text.is_empty() {
            return true;
        }
        let decoded = match serde_json::from_slice::<Line>(text) {
            Ok(line) => line.report(self.calibration),
            Err(error) if error.is_data() => None,
            Err(_) => return false,
        };
        match decoded {
            Some(decoded) => {
                self.stats.reports = self.stats.reports.saturating_add(1);
                report(decoded);
            }
            None => self.stats.malformed = self.stats.malformed.saturating_add(1),
        }
        true
    }

    fn start_line(&mut self) {
        self.held.clear();
        self.skipping = false;
    }
}

impl Format for JsonLines {
    fn receive(&mut self, bytes: &[u8], report: &mut dyn FnMut(Report), _: &mut dyn FnMut(&[u8])) {
        self.stats.count_bytes(bytes);
        for &byte in bytes {
            if byte == b'\n' {
                if self.skipping || !self.end_line(report) {
                    self.stats.framing = self.stats.framing.saturating_add(1);
                }
                self.start_line();
            } else if self.held.len() < LINE_BYTES {
                self.held.push(byte);
            } else {
                self.skipping = true;
            }
        }
        // A datagram often holds one object without a line end.
        if self.held.ends_with(b"}") && !self.skipping && self.end_line(report) {
            self.start_line();
        }
    }

    fn stats(&self) -> ReportStats {
        self.stats
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(format: &mut JsonLines, bytes: &[u8]) -> Vec<Report> {
        let mut reports = Vec::new();
        format.receive(bytes, &mut |report| reports.push(report), &mut |_| panic!("no answers"));
        reports
    }

    #[test]
    fn lines_and_datagrams_are_read() {
        let mut format = JsonLines::default();
        let first = Report { device: 1, snr: Db(2.5), remaining: Some(1000.0), age_ms: 200 };
        let text = br#"{"id":1,"snr_db":2.5,"remaining":1000,"age_s":0.2}"#;
        assert_eq!(read(&mut format, text), [first], "a datagram");
        let (head, tail) = text.split_at(17);
        assert_eq!(read(&mut format, head), []);
        assert_eq!(read(&mut format, tail), [first], "two pieces");
        let second = Report { device: 0x2601_1BDA, snr: Db(-3.0), remaining: None, age_ms: 0 };
        for name in [
            r#""id":"26011BDA""#,
            r#""dev_addr":"26011bda""#,
            r#""dev_eui":"70B3D57E26011BDA""#,
            r#""id":637606874"#,
        ] {
            let line = std::format!("{{{name},\"snr_db\":-3,\"rssi\":-90}}\r\n");
            assert_eq!(read(&mut format, line.as_bytes()), [second], "{line}");
        }
        assert_eq!(format.stats().reports, 6);
    }

    #[test]
    fn other_text_is_counted_by_reason() {
        let mut format = JsonLines::default();
        for line in ["$GPGGA,123519\n", "{\"id\":1}\n", "{\"id\":\"x\",\"snr_db\":1}\n", "[1,2\n"] {
            assert_eq!(read(&mut format, line.as_bytes()), []);
        }
        assert_eq!(read(&mut format, &[b'{'; 3000]), []);
        assert_eq!(read(&mut format, b"\n"), []);
        let stats = format.stats();
        assert_eq!((stats.reports, stats.framing, stats.malformed), (0, 3, 2));
    }

    #[test]
    fn the_calibration_applies() {
        let mut format = JsonLines::new(Calibration { offset: Db(1.0), slope: 2.0 });
        assert_eq!(read(&mut format, br#"{"id":1,"snr_db":3}"#)[0].snr, Db(7.0));
    }
}
