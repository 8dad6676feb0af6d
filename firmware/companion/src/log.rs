//! The decision log: `decisions.jsonl`, one JSON object a line, flushed line by line.
//!
//! A disk may be slow, full or gone; the flight goes on. A thread of its own writes, so that the decision loop
//! never waits for a disk. What could not be written is counted, and said once.

use crate::error::StartError;
use gleaner_pilot::{Decision, LoggedDecision};
use gleaner_units::Duration;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{SystemTime, UNIX_EPOCH};

/// Lines that wait for a slow disk: minutes of decisions.
const LINES_WAITING: usize = 256;

/// The open log.
pub struct DecisionLog {
    run_s: u64,
    lines: SyncSender<String>,
    writer: JoinHandle<()>,
    /// Lines that found no room, not yet said.
    overflowed: bool,
}

impl DecisionLog {
    /// Opens `decisions.jsonl` in `folder`, which is made if it is not there; new lines follow old ones.
    ///
    /// # Errors
    /// The folder cannot be made, or the file cannot be opened.
    pub fn open(folder: &Path) -> Result<DecisionLog, StartError> {
        let path = folder.join("decisions.jsonl");
        let file = fs::create_dir_all(folder)
            .and_then(|()| OpenOptions::new().create(true).append(true).open(&path))
            .map_err(|source| StartError::Log { path: path.clone(), source })?;
        let (lines, waiting) = sync_channel(LINES_WAITING);
        let writer = std::thread::spawn(move || write_all(&waiting, file));
        let run_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        Ok(DecisionLog { run_s, lines, writer, overflowed: false })
    }

    /// Hands one decision to the writer. Never waits.
    pub fn write(&mut self, decision: &Decision, inference_time: Option<Duration>) {
        let line = line(self.run_s, decision, inference_time);
        match self.lines.try_send(line) {
            Ok(()) => self.overflowed = false,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
                if !std::mem::replace(&mut self.overflowed, true) {
                    tracing::error!("decision log: the disk is too slow, decisions go unlogged; flying on");
                }
            }
        }
    }

    /// Waits until everything is written.
    pub fn close(self) {
        drop(self.lines);
        // The writer does not panic; if it did, that was said on stderr.
        let _ = self.writer.join();
    }
}

fn line(run_s: u64, decision: &Decision, inference_time: Option<Duration>) -> String {
    // Serialising cannot fail: every key is a string.
    serde_json::to_string(&LoggedDecision::new(run_s, decision, inference_time)).unwrap_or_default()
}

fn write_all(lines: &Receiver<String>, file: File) {
    let mut journal = Journal { file, lost: 0 };
    for line in lines {
        journal.write(&line);
    }
    if journal.lost > 0 {
        tracing::error!("decision log: {} decisions were not written", journal.lost);
    }
}

/// A file of lines that survives failures to write.
struct Journal<W> {
    file: W,
    lost: u64,
}

impl<W: Write> Journal<W> {
    fn write(&mut self, line: &str) {
        match self.try_write(line) {
            Ok(()) if self.lost > 0 => {
                tracing::warn!("decision log: writing again after {} lost decisions", self.lost);
                self.lost = 0;
            }
            Ok(()) => {}
            Err(error) => {
                if self.lost == 0 {
                    tracing::error!(
                        "decision log: {error}: make room on the disk; flying on without the log"
                    );
                }
                self.lost += 1;
            }
        }
    }

    /// After a failure half a line may stand in the file: it is ended first.
    fn try_write(&mut self, line: &str) -> io::Result<()> {
        let start = if self.lost > 0 { "\n" } else { "" };
        self.file.write_all(format!("{start}{line}\n").as_bytes())?;
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk with so many bytes left.
    struct Disk {
        left: usize,
        bytes: Vec<u8>,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let fits = bytes.len().min(self.left);
            if fits == 0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.left -= fits;
            self.bytes.extend(&bytes[..fits]);
            Ok(fits)
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_full_disk_costs_only_the_lines_that_did_not_fit() {
        let mut journal = Journal { file: Disk { left: 8, bytes: Vec::new() }, lost: 0 };
        journal.write("first");
        journal.write("second");
        journal.write("third");
        assert_eq!(journal.lost, 2);
        journal.file.left = 100;
        journal.write("fourth");
        assert_eq!(journal.lost, 0);
        assert_eq!(String::from_utf8(journal.file.bytes).unwrap(), "first\nse\nfourth\n");
    }
}
