//! Files that are replaced whole, on a thread of their own.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

/// Replaces the file: after a loss of power it holds the old or the new content, never a part.
///
/// # Errors
/// Those of the file system.
pub fn replace(path: &Path, content: &[u8]) -> io::Result<()> {
    let temporary = path.with_extension("new");
    let mut file = File::create(&temporary)?;
    file.write_all(content)?;
    file.sync_all()?;
    fs::rename(&temporary, path)?;
    // The rename lasts once the folder is written.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}

/// Replaces one file again and again. The caller never waits for the disk.
pub struct Replacer {
    contents: Sender<Vec<u8>>,
    errors: Receiver<io::Error>,
    thread: JoinHandle<()>,
}

impl Replacer {
    /// Starts the thread for the file at `path`.
    pub fn start(path: PathBuf) -> Replacer {
        let (contents, waiting) = channel::<Vec<u8>>();
        let (failed, errors) = channel();
        let thread = std::thread::spawn(move || {
            while let Ok(first) = waiting.recv() {
                // Only the newest content counts.
                let newest = waiting.try_iter().last().unwrap_or(first);
                if let Err(error) = replace(&path, &newest) {
                    // At the end of the run no one receives it any more.
                    let _ = failed.send(error);
                }
            }
        });
        Replacer { contents, errors, thread }
    }

    /// Hands over new content.
    pub fn put(&self, content: impl Into<Vec<u8>>) {
        // The thread ends only with this end of the channel.
        let _ = self.contents.send(content.into());
    }

    /// The next failure, if there was one.
    pub fn error(&self) -> Option<io::Error> {
        self.errors.try_recv().ok()
    }

    /// Waits until the newest content is written.
    pub fn close(self) {
        drop(self.contents);
        // The thread does not panic; if it did, stderr shows it.
        let _ = self.thread.join();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_content_is_written_and_nothing_is_left_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file.toml");
        let replacer = Replacer::start(path.clone());
        for index in 0..100 {
            replacer.put(format!("{index}"));
        }
        replacer.close();
        assert_eq!(fs::read_to_string(path).unwrap(), "99");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_failure_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let replacer = Replacer::start(folder.path().join("no/such/folder.toml"));
        replacer.put("x");
        assert_eq!(replacer.errors.recv().unwrap().kind(), io::ErrorKind::NotFound);
        replacer.close();
    }
}
