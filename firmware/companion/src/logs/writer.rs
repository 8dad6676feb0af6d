//! A log written by a thread of its own, so that the decision loop never waits for a disk.

use super::rotation::RotatingFile;
use std::sync::mpsc::{Receiver, Sender, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Records that wait for a slow disk: hours of decisions, a minute of telemetry, most of a second of a flood.
const RECORDS_WAITING: usize = 8192;

/// A change that is reported to the operator. The flight continues in every case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LogNews {
    /// Records are lost because the disk is full or broken; the text says why.
    Failing(&'static str, String),
    /// Records are lost because the disk is slow.
    Slow(&'static str),
    /// Records are written again; this many were lost.
    Writing(&'static str, u64),
}

/// Where a log reports to.
pub type NewsSender = Sender<LogNews>;

/// An open log.
pub struct LogWriter {
    name: &'static str,
    records: SyncSender<Vec<u8>>,
    thread: JoinHandle<()>,
    news: NewsSender,
    /// Records found no room, and that was reported.
    overflowed: bool,
}

impl LogWriter {
    /// Starts the thread. After a failure `repair` goes before the next record, for example to end half a line. Records
    /// that follow one within `gather` are written with it at once: the price is that a killed program loses them.
    pub fn start(
        name: &'static str,
        file: RotatingFile,
        repair: &'static [u8],
        gather: Duration,
        news: NewsSender,
    ) -> LogWriter {
        let (records, waiting) = sync_channel(RECORDS_WAITING);
        let thread = {
            let news = news.clone();
            std::thread::spawn(move || write_all(name, &waiting, file, repair, gather, &news))
        };
        LogWriter { name, records, thread, news, overflowed: false }
    }

    /// Hands over one record. Never waits.
    pub fn write(&mut self, record: Vec<u8>) {
        match self.records.try_send(record) {
            Ok(()) => self.overflowed = false,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
                if !std::mem::replace(&mut self.overflowed, true) {
                    // At the end of the run the receiver is gone.
                    let _ = self.news.send(LogNews::Slow(self.name));
                }
            }
        }
    }

    /// Waits until everything is written.
    pub fn close(self) {
        drop(self.records);
        // The thread does not panic; if it did, stderr shows it.
        let _ = self.thread.join();
    }
}

fn write_all(
    name: &'static str,
    records: &Receiver<Vec<u8>>,
    mut file: RotatingFile,
    repair: &[u8],
    gather: Duration,
    news: &NewsSender,
) {
    let mut recovery = Recovery { name, lost: 0 };
    while let Ok(mut batch) = records.recv() {
        // The receiver waits for no record meanwhile, so that handing one over wakes no thread.
        std::thread::sleep(gather);
        let mut count = 1;
        for record in records.try_iter() {
            batch.extend(record);
            count += 1;
        }
        recovery.write(&batch, count, repair, news, |bytes| file.write(bytes));
    }
    if recovery.lost > 0 {
        tracing::error!("{name}: {} records were not written", recovery.lost);
    }
}

/// Counts what is lost, and reports the first loss and the end of it.
struct Recovery {
    name: &'static str,
    lost: u64,
}

impl Recovery {
    /// Writes `count` records.
    fn write(
        &mut self,
        records: &[u8],
        count: u64,
        repair: &[u8],
        news: &NewsSender,
        mut write: impl FnMut(&[u8]) -> std::io::Result<()>,
    ) {
        let written = if self.lost > 0 { write(&[repair, records].concat()) } else { write(records) };
        let report = match written {
            Ok(()) if self.lost > 0 => LogNews::Writing(self.name, std::mem::take(&mut self.lost)),
            Ok(()) => return,
            Err(error) => {
                let is_first = self.lost == 0;
                self.lost += count;
                if !is_first {
                    return;
                }
                LogNews::Failing(self.name, error.to_string())
            }
        };
        // At the end of the run the receiver is gone.
        let _ = news.send(report);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn a_full_disk_costs_only_the_records_that_do_not_fit() {
        let (news, heard) = channel();
        let mut recovery = Recovery { name: "log", lost: 0 };
        let (mut disk, mut room) = (Vec::new(), 8);
        let mut record = |bytes: &[u8], more: usize| {
            room += more;
            recovery.write(bytes, 1, b"\n", &news, |bytes| {
                let fits = bytes.len().min(room);
                room -= fits;
                disk.extend_from_slice(&bytes[..fits]);
                if fits < bytes.len() { Err(std::io::ErrorKind::StorageFull.into()) } else { Ok(()) }
            });
        };
        record(b"first\n", 0);
        record(b"second\n", 0);
        record(b"third\n", 0);
        record(b"fourth\n", 100);
        assert_eq!(String::from_utf8(disk).unwrap(), "first\nse\nfourth\n");
        let reports: Vec<LogNews> = heard.try_iter().collect();
        assert!(
            matches!(reports[..], [LogNews::Failing("log", _), LogNews::Writing("log", 2)]),
            "{reports:?}"
        );
    }
}
