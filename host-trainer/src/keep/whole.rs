//! Files that are whole at every moment.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// Writes the file so that `path` is at every moment either what it was or the new one, also after a power cut.
///
/// # Errors
/// A full disk, mostly. What was there is then still there.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let temporary = path.with_extension("writing");
    let write = || -> io::Result<()> {
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        // On the disk before the name points to it.
        file.sync_all()?;
        fs::rename(&temporary, path)
    };
    write().inspect_err(|_| {
        let _ = fs::remove_file(&temporary);
    })
}
