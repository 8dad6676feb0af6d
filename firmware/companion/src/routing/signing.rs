//! MAVLink 2 signing on a port: the key file, and the timestamps that outlive a run.

use super::packets::Packet;
use crate::keep::Replacer;
use gleaner_link::{FrameDecoder, Signing, SigningKey, SigningState, SigningStats, SigningTime, StateError};
use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// MAVLink asks for once a minute at least.
const STORE_EVERY: Duration = Duration::from_secs(20);

/// Why a port cannot sign.
#[derive(Debug, thiserror::Error)]
pub enum SigningError {
    /// The file cannot be read.
    #[error("cannot be read: {0}: correct signing.key, or the file's permissions")]
    Read(io::Error),
    /// Other users could use the key.
    #[error("other users can read it (mode {mode:o}): chmod 600")]
    Permissions {
        /// The permission bits.
        mode: u32,
    },
    /// There is no key in the file.
    #[error("it is empty: write 64 hexadecimal digits, or a passphrase of 8 characters or more")]
    Short,
    /// The timestamps of the last run are damaged.
    #[error("{0}: replays could not be told apart; delete the file if the key is new")]
    State(StateError),
}

/// Reads the key: 64 hexadecimal digits, or a passphrase as ground stations take it.
///
/// # Errors
/// See [`SigningError`].
pub fn read_key(path: &Path) -> Result<SigningKey, SigningError> {
    let mode = fs::metadata(path).map_err(SigningError::Read)?.permissions().mode() & 0o777;
    if mode & 0o077 != 0 {
        return Err(SigningError::Permissions { mode });
    }
    let text = fs::read_to_string(path).map_err(SigningError::Read)?;
    let text = text.trim();
    if let Some(key) = hexadecimal(text) {
        return Ok(SigningKey::new(key));
    }
    if text.chars().count() < 8 {
        return Err(SigningError::Short);
    }
    Ok(SigningKey::from_passphrase(text))
}

fn hexadecimal(text: &str) -> Option<[u8; SigningKey::BYTES]> {
    if text.len() != 2 * SigningKey::BYTES || !text.is_ascii() {
        return None;
    }
    let mut key = [0; SigningKey::BYTES];
    for (byte, at) in key.iter_mut().zip((0..text.len()).step_by(2)) {
        *byte = u8::from_str_radix(text.get(at..at + 2)?, 16).ok()?;
    }
    Some(key)
}

/// Signs and verifies the packets of one port.
pub struct SignedPort {
    signing: Signing,
    decoder: FrameDecoder,
    file: Option<Replacer>,
    stored_at: Option<Instant>,
}

impl SignedPort {
    /// A port that signs with `key`. `number` names it in the signatures; its timestamps are kept in `folder`.
    ///
    /// # Errors
    /// The timestamps of the last run are damaged.
    pub fn open(
        key: SigningKey,
        number: u8,
        folder: Option<&Path>,
    ) -> Result<SignedPort, (PathBuf, SigningError)> {
        let path = folder.map(|folder| folder.join(format!("signing.{number}.state")));
        let stored = path
            .as_deref()
            .map(stored)
            .transpose()
            .map_err(|source| (path.clone().unwrap_or_default(), source))?;
        Ok(SignedPort {
            signing: Signing::new(key, number, wall_time(), stored.flatten()),
            decoder: FrameDecoder::new(),
            file: path.map(Replacer::start),
            stored_at: None,
        })
    }

    /// Whether the packet's signature is right and new.
    pub fn check(&mut self, packet: &Packet) -> bool {
        self.signing.set_clock(wall_time());
        // A whole packet of a known message is one frame for the decoder; an unknown one cannot be verified.
        let mut rest = &packet.bytes[..];
        let frame = self.decoder.read(&mut rest);
        rest.is_empty() && frame.is_some_and(|frame| self.signing.check(&frame).is_ok())
    }

    /// The packet with a signature. `None`: it must not be sent on this port.
    pub fn sign(&mut self, packet: &[u8]) -> Option<Vec<u8>> {
        const SIGNED: u8 = 1;
        if packet.first() == Some(&0xFD) && packet.get(2).is_some_and(|flags| flags & SIGNED != 0) {
            // Signed by its sender: a router does not replace a signature.
            return Some(packet.to_vec());
        }
        self.signing.set_clock(wall_time());
        self.signing.sign(packet).map(|signed| signed.to_vec())
    }

    /// Stores the timestamps when it is time.
    pub fn pass_time(&mut self, now: Instant) {
        let due = self.stored_at.is_none_or(|at| now.saturating_duration_since(at) >= STORE_EVERY);
        if let Some(file) = self.file.as_ref().filter(|_| due) {
            self.stored_at = Some(now);
            file.put(self.signing.state().to_bytes().to_vec());
        }
    }

    /// Stores the timestamps and waits for the disk.
    pub fn close(self) {
        if let Some(file) = self.file {
            file.put(self.signing.state().to_bytes().to_vec());
            file.close();
        }
    }

    /// The counters.
    pub fn stats(&self) -> SigningStats {
        self.signing.stats()
    }
}

fn stored(path: &Path) -> Result<Option<SigningState>, SigningError> {
    match fs::read(path) {
        Ok(bytes) => SigningState::from_bytes(&bytes).map(Some).map_err(SigningError::State),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(SigningError::Read(error)),
    }
}

fn wall_time() -> SigningTime {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    SigningTime::from_unix_micros(u64::try_from(since_1970.as_micros()).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::super::packets::Packets;
    use super::super::packets::tests::heartbeat;
    use super::*;

    fn key_file(text: &str, mode: u32) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        fs::set_permissions(file.path(), fs::Permissions::from_mode(mode)).unwrap();
        file
    }

    fn packet(bytes: &[u8]) -> Packet {
        let mut found = Vec::new();
        Packets::default().push(bytes, |packet| found.push(packet));
        found.remove(0)
    }

    #[test]
    fn a_key_that_others_can_read_is_refused() {
        let hex = "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff";
        assert!(read_key(key_file(hex, 0o600).path()).is_ok());
        assert!(read_key(key_file("correct horse battery\n", 0o400).path()).is_ok());
        for (text, mode, expected) in
            [(hex, 0o640, "mode 640"), (hex, 0o604, "mode 604"), ("short", 0o600, "it is empty")]
        {
            let error = read_key(key_file(text, mode).path()).err().unwrap().to_string();
            assert!(error.contains(expected), "{error}");
        }
        assert!(matches!(read_key(Path::new("/no/such/key")), Err(SigningError::Read(_))));
    }

    #[test]
    fn a_replay_is_refused_after_a_restart_too() {
        let folder = tempfile::tempdir().unwrap();
        let open = |number| {
            SignedPort::open(SigningKey::from_passphrase("a passphrase"), number, Some(folder.path()))
                .unwrap()
        };
        let (mut ours, mut theirs) = (open(1), open(2));
        let bytes = theirs.sign(&heartbeat((255, 190), 0)).unwrap();
        assert!(!ours.check(&packet(&heartbeat((255, 190), 0))), "unsigned");
        assert!(ours.check(&packet(&bytes)));
        assert!(!ours.check(&packet(&bytes)), "replayed");
        let mut wrong = bytes.clone();
        *wrong.last_mut().unwrap() ^= 1;
        assert!(!ours.check(&packet(&wrong)), "altered");
        assert_eq!(theirs.sign(&bytes).unwrap(), bytes, "signed by its sender");
        ours.close();
        let mut again = open(1);
        assert!(!again.check(&packet(&bytes)), "replayed after a restart");
        assert!(again.check(&packet(&theirs.sign(&heartbeat((255, 190), 1)).unwrap())));
    }

    #[test]
    fn damaged_timestamps_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("signing.1.state"), b"damaged").unwrap();
        let opened = SignedPort::open(SigningKey::from_passphrase("a passphrase"), 1, Some(folder.path()));
        assert!(matches!(opened, Err((_, SigningError::State(_)))));
    }
}
