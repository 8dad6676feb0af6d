//! What to say when the radio's bytes or reports are not as expected.

use crate::format::ReportStats;
use crate::table::TableStats;
use core::fmt;
use gleaner_units::{Duration, Instant};

/// Likely origin of bytes that are no reports, judged by how they begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Likely {
    /// A JSON object: `format = "json_lines"`.
    Json,
    /// A Semtech packet forwarder: `format = "semtech_udp"`.
    Semtech,
    /// MAVLink, which belongs on the autopilot's port.
    MavLink,
    /// Sentences of a GNSS receiver.
    Nmea,
    /// Answers of a modem with AT commands.
    AtModem,
    /// Frames of the Meshtastic serial interface.
    Meshtastic,
    /// Anything else.
    Unknown,
}

impl Likely {
    /// Judges the first bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Likely {
        match bytes {
            [b'{', ..] => Likely::Json,
            [1..=2, _, _, 0 | 2, ..] => Likely::Semtech,
            [0xFD | 0xFE, ..] => Likely::MavLink,
            [b'$', b'A'..=b'Z', ..] => Likely::Nmea,
            [b'+' | b'A', b'A'..=b'Z', ..] => Likely::AtModem,
            [0x94, 0xC3, ..] => Likely::Meshtastic,
            _ => Likely::Unknown,
        }
    }
}

impl fmt::Display for Likely {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Likely::Json => "looks like JSON",
            Likely::Semtech => "is it Semtech UDP?",
            Likely::MavLink => "looks like MAVLink",
            Likely::Nmea => "looks like NMEA",
            Likely::AtModem => "is it an AT modem?",
            Likely::Meshtastic => "is it Meshtastic?",
            Likely::Unknown => "format or baud?",
        })
    }
}

/// One line for the operator; at most 50 characters with figures below 100,000.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remark {
    /// Bytes arrive and no report does.
    NoReports {
        /// Bytes since the last report.
        bytes: u32,
        /// Their likely origin.
        likely: Likely,
    },
    /// Reports of devices that are not part of the mission.
    Unknown(u32),
    /// Reports with numbers that are not allowed.
    BadValues(u32),
    /// Remaining amounts above the mission's figure.
    Capped(u32),
    /// Remaining amounts that fell faster than slots can carry.
    Limited(u32),
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Remark::NoReports { bytes, likely } => write!(f, "radio: {bytes} bytes, 0 reports: {likely}"),
            Remark::Unknown(count) => write!(f, "radio: {count} reports of unknown devices"),
            Remark::BadValues(count) => write!(f, "radio: {count} reports with bad numbers"),
            Remark::Capped(count) => write!(f, "radio: {count} amounts above the mission's"),
            Remark::Limited(count) => write!(f, "radio: {count} amounts fell too fast"),
        }
    }
}

/// Watches the counters of one radio.
#[derive(Clone, Debug, Default)]
pub struct Reception {
    checked_at: Option<Instant>,
    radio: ReportStats,
    table: TableStats,
    first_bytes: [u8; 4],
    filled: usize,
}

impl Reception {
    /// Before the first byte.
    #[must_use]
    pub const fn new() -> Reception {
        let table = TableStats { unknown: 0, outdated: 0, bad_values: 0, capped: 0, limited: 0 };
        Reception { checked_at: None, radio: ReportStats::NONE, table, first_bytes: [0; 4], filled: 0 }
    }

    /// At most one round of remarks in this time.
    const PERIOD: Duration = Duration::from_secs(10);
    /// Fewer bytes without a report are the start of one.
    const ENOUGH_BYTES: u32 = 32;

    /// Takes a look at received bytes; the first ones of each period are kept.
    pub fn see(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let Some(slot) = self.first_bytes.get_mut(self.filled) else { return };
            *slot = byte;
            self.filled += 1;
        }
    }

    /// Compares the counters with those of the last period and calls `say` for what is wrong.
    pub fn poll(
        &mut self,
        now: Instant,
        radio: &ReportStats,
        table: &TableStats,
        mut say: impl FnMut(Remark),
    ) {
        let checked_at = *self.checked_at.get_or_insert(now);
        if now.since(checked_at) < Reception::PERIOD {
            return;
        }
        self.checked_at = Some(now);
        let bytes = radio.bytes.saturating_sub(self.radio.bytes);
        if bytes >= Reception::ENOUGH_BYTES && radio.reports == self.radio.reports {
            let likely = Likely::of(self.first_bytes.get(..self.filled).unwrap_or(&[]));
            say(Remark::NoReports { bytes, likely });
        }
        let more = |now: u32, before: u32| Some(now.saturating_sub(before)).filter(|&more| more > 0);
        let last = &self.table;
        let remarks = [
            more(table.unknown, last.unknown).map(Remark::Unknown),
            more(table.bad_values, last.bad_values).map(Remark::BadValues),
            more(table.capped, last.capped).map(Remark::Capped),
            more(table.limited, last.limited).map(Remark::Limited),
        ];
        remarks.into_iter().flatten().for_each(say);
        (self.radio, self.table, self.filled) = (*radio, *table, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReportDecoder;
    use std::string::{String, ToString};
    use std::vec::Vec;

    fn remarks(bytes: &[u8]) -> Vec<String> {
        let (mut reception, mut decoder) = (Reception::default(), ReportDecoder::new());
        let mut said = Vec::new();
        for second in 0..=10 {
            reception.see(bytes);
            decoder.push(bytes, |_| {});
            let now = Instant::from_millis(second * 1_000);
            reception
                .poll(now, &decoder.stats(), &TableStats::default(), |remark| said.push(remark.to_string()));
        }
        said
    }

    #[test]
    fn bytes_without_reports_are_named_with_a_likely_cause() {
        for (bytes, cause) in [
            (&b"+RCV=1,5,HELLO,-99,40\r\n"[..], "is it an AT modem?"),
            (b"$GPGGA,123519,4807.038,N\r\n", "looks like NMEA"),
            (b"{\"id\":1,\"snr_db\":2.5}\n", "looks like JSON"),
            (&[0x94, 0xC3, 0, 16, 1, 2, 3], "is it Meshtastic?"),
            (&[2, 0x12, 0x34, 0, 0xAA, 0x55], "is it Semtech UDP?"),
            (&[0xFD, 9, 0, 0, 1], "looks like MAVLink"),
            (&[0x55, 0xAA, 0x17, 0x99], "format or baud?"),
        ] {
            let said = remarks(bytes);
            assert_eq!(said, [std::format!("radio: {} bytes, 0 reports: {cause}", 11 * bytes.len())]);
        }
        assert!(remarks(&[]).is_empty(), "silence is not this fault");
        let report = crate::Report { device: 1, snr: gleaner_units::Db(1.0), remaining: None, age_ms: 0 };
        assert!(remarks(&crate::encode(&report)).is_empty());
    }

    #[test]
    fn remarks_fit_a_status_text() {
        for likely in [Likely::Semtech, Likely::Unknown] {
            assert!(Remark::NoReports { bytes: 9_999, likely }.to_string().len() <= 50);
        }
        assert!(Remark::Capped(99_999).to_string().len() <= 50);
    }

    #[test]
    fn each_counter_is_reported_when_it_moves() {
        let mut reception = Reception::default();
        let stats = TableStats { unknown: 3, outdated: 9, bad_values: 1, capped: 2, limited: 4 };
        let mut said = Vec::new();
        for second in [0, 5, 10, 20] {
            let now = Instant::from_millis(second * 1_000);
            reception.poll(now, &ReportStats::NONE, &stats, |remark| said.push(remark));
        }
        let all = [Remark::Unknown(3), Remark::BadValues(1), Remark::Capped(2), Remark::Limited(4)];
        assert_eq!(said, all);
    }
}
