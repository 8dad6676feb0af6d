//! The telemetry log: `flight.tlog`, every MAVLink packet of the run, as ground stations, pymavlink and MAVExplorer read
//! it.

use super::LogError;
use super::rotation::{Limits, RotatingFile};
use super::writer::{LogWriter, NewsSender};
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Packets of this time are written at once: ten writes a second instead of one per packet.
const GATHER: Duration = Duration::from_millis(100);

/// The open log.
pub struct TelemetryLog {
    writer: LogWriter,
}

impl TelemetryLog {
    /// Begins `flight.tlog` in `folder`; the files of earlier runs are kept as `flight.1.tlog` and so on.
    ///
    /// # Errors
    /// The folder cannot be made, or the file cannot be opened.
    pub fn open(folder: &Path, limits: Limits, news: NewsSender) -> Result<TelemetryLog, LogError> {
        let file = RotatingFile::open(folder, "flight", "tlog", limits, true)
            .map_err(|source| LogError { path: folder.join("flight.tlog"), source })?;
        Ok(TelemetryLog { writer: LogWriter::start("telemetry log", file, b"", GATHER, news) })
    }

    /// Hands one packet to the writer. Never waits.
    pub fn write(&mut self, packet: &[u8]) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        self.writer.write(record(now, packet));
    }

    /// Waits until everything is written.
    pub fn close(self) {
        self.writer.close();
    }
}

/// The time in microseconds since 1970 as eight big-endian bytes, then the packet.
fn record(since_1970: Duration, packet: &[u8]) -> Vec<u8> {
    let micros = u64::try_from(since_1970.as_micros()).unwrap_or(u64::MAX);
    [&micros.to_be_bytes()[..], packet].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_a_time_and_a_packet() {
        let record = record(Duration::from_micros(0x0102), b"packet");
        assert_eq!(record, b"\0\0\0\0\0\0\x01\x02packet");
    }
}
