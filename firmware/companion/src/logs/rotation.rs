//! A file that is renamed when it is long, and that leaves room on the disk.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Files kept beside the current one.
const KEPT: u32 = 8;
/// Bytes between two checks of the free space.
const LOOK_EVERY: u64 = 64 * 1024;

/// How much of the disk a log may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// A longer file is renamed and a new one begun.
    pub file_bytes: u64,
    /// Free space that is left to others. Below it the oldest files are deleted, then nothing is written.
    pub min_free_bytes: u64,
}

/// Space left on the file system of a folder.
pub type FreeSpace = fn(&Path) -> io::Result<u64>;

/// `NAME.EXT` in a folder, with older files `NAME.1.EXT`, `NAME.2.EXT` and so on, the oldest last.
pub struct RotatingFile {
    folder: PathBuf,
    name: &'static str,
    extension: &'static str,
    limits: Limits,
    free_space: FreeSpace,
    file: File,
    /// Bytes in the current file.
    bytes: u64,
    /// Bytes written since the free space was looked up; at first more than [`LOOK_EVERY`].
    unlooked: u64,
}

impl RotatingFile {
    /// Opens the current file to append, or begins a new one if `fresh`. The folder is made if it is not there.
    ///
    /// # Errors
    /// The folder cannot be made, or the file cannot be opened.
    pub fn open(
        folder: &Path,
        name: &'static str,
        extension: &'static str,
        limits: Limits,
        fresh: bool,
    ) -> io::Result<RotatingFile> {
        RotatingFile::open_with(folder, name, extension, limits, fresh, free_space)
    }

    fn open_with(
        folder: &Path,
        name: &'static str,
        extension: &'static str,
        limits: Limits,
        fresh: bool,
        free_space: FreeSpace,
    ) -> io::Result<RotatingFile> {
        fs::create_dir_all(folder)?;
        let current = path(folder, name, extension, 0);
        if fresh && current.exists() {
            shift(folder, name, extension)?;
        }
        let file = OpenOptions::new().create(true).append(true).open(&current)?;
        let bytes = file.metadata()?.len();
        let folder = folder.to_owned();
        Ok(RotatingFile { folder, name, extension, limits, free_space, file, bytes, unlooked: LOOK_EVERY })
    }

    /// Appends one record whole, or fails. After a failure a part of it may stand in the file.
    ///
    /// # Errors
    /// The disk is full, or fuller than the limit allows; or the error of the system.
    pub fn write(&mut self, record: &[u8]) -> io::Result<()> {
        if self.bytes > 0 && self.bytes + record.len() as u64 > self.limits.file_bytes {
            shift(&self.folder, self.name, self.extension)?;
            let current = path(&self.folder, self.name, self.extension, 0);
            self.file = OpenOptions::new().create(true).append(true).open(current)?;
            self.bytes = 0;
        }
        if self.unlooked >= LOOK_EVERY {
            self.make_room()?;
            self.unlooked = 0;
        }
        self.file.write_all(record)?;
        self.file.flush()?;
        self.bytes += record.len() as u64;
        self.unlooked += record.len() as u64;
        Ok(())
    }

    /// Deletes the oldest files of this log until enough is free.
    fn make_room(&self) -> io::Result<()> {
        let is_free =
            || Ok::<bool, io::Error>((self.free_space)(&self.folder)? >= self.limits.min_free_bytes);
        for age in (1..=KEPT).rev() {
            if is_free()? {
                return Ok(());
            }
            let oldest = path(&self.folder, self.name, self.extension, age);
            if oldest.exists() {
                fs::remove_file(oldest)?;
            }
        }
        if is_free()? {
            return Ok(());
        }
        let min_free_mb = self.limits.min_free_bytes >> 20;
        Err(io::Error::new(io::ErrorKind::StorageFull, format!("less than {min_free_mb} MB free")))
    }
}

fn path(folder: &Path, name: &str, extension: &str, age: u32) -> PathBuf {
    match age {
        0 => folder.join(format!("{name}.{extension}")),
        _ => folder.join(format!("{name}.{age}.{extension}")),
    }
}

/// Renames each file to the next age; the oldest is overwritten.
fn shift(folder: &Path, name: &str, extension: &str) -> io::Result<()> {
    for age in (0..KEPT).rev() {
        let from = path(folder, name, extension, age);
        if from.exists() {
            fs::rename(from, path(folder, name, extension, age + 1))?;
        }
    }
    Ok(())
}

fn free_space(folder: &Path) -> io::Result<u64> {
    let disk = rustix::fs::statvfs(folder)?;
    Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOMY: Limits = Limits { file_bytes: 10, min_free_bytes: 0 };

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_long_file_is_renamed_and_the_oldest_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = RotatingFile::open(folder.path(), "log", "txt", ROOMY, false).unwrap();
        for index in 0..12 {
            file.write(format!("{index:08}").as_bytes()).unwrap();
        }
        assert_eq!(names(folder.path()).len(), 1 + KEPT as usize);
        assert_eq!(fs::read_to_string(folder.path().join("log.txt")).unwrap(), "00000011");
        assert_eq!(fs::read_to_string(folder.path().join("log.8.txt")).unwrap(), "00000003");
    }

    #[test]
    fn a_fresh_file_keeps_the_one_before_it() {
        let folder = tempfile::tempdir().unwrap();
        for (text, fresh) in [("a", true), ("b", true), ("c", false)] {
            let mut file = RotatingFile::open(folder.path(), "log", "txt", ROOMY, fresh).unwrap();
            file.write(text.as_bytes()).unwrap();
        }
        assert_eq!(names(folder.path()), ["log.1.txt", "log.txt"]);
        assert_eq!(fs::read_to_string(folder.path().join("log.txt")).unwrap(), "bc");
    }

    #[test]
    fn old_files_are_deleted_for_room_and_then_nothing_is_written() {
        // Each missing file frees one byte.
        fn nearly_full(folder: &Path) -> io::Result<u64> {
            Ok(10 - fs::read_dir(folder)?.count() as u64)
        }
        let folder = tempfile::tempdir().unwrap();
        for age in 1..=3 {
            fs::write(path(folder.path(), "log", "txt", age), "old").unwrap();
        }
        let mut limits = Limits { file_bytes: 1000, min_free_bytes: 7 };
        let open = |limits| {
            RotatingFile::open_with(folder.path(), "log", "txt", limits, false, nearly_full).unwrap()
        };
        open(limits).write(b"x").unwrap();
        assert_eq!(names(folder.path()), ["log.1.txt", "log.2.txt", "log.txt"], "the oldest went");
        limits.min_free_bytes = 10;
        let error = open(limits).write(b"y").unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert_eq!(fs::read_to_string(folder.path().join("log.txt")).unwrap(), "x");
    }
}
