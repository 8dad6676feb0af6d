//! Keys and timestamps.

use core::fmt;
use sha2::{Digest, Sha256};

/// The shared secret of a port, 32 bytes. `Debug` does not print it.
#[derive(Clone, PartialEq, Eq)]
pub struct SigningKey([u8; SigningKey::BYTES]);

impl SigningKey {
    /// Length of a key, bytes.
    pub const BYTES: usize = 32;

    /// A key from its bytes.
    #[must_use]
    pub const fn new(bytes: [u8; SigningKey::BYTES]) -> SigningKey {
        SigningKey(bytes)
    }

    /// The key that ground stations derive from a passphrase: its SHA-256 (Mission Planner, MAVProxy
    /// `signing setup`, QGroundControl).
    #[must_use]
    pub fn from_passphrase(passphrase: &str) -> SigningKey {
        SigningKey(Sha256::digest(passphrase.as_bytes()).into())
    }

    /// First 6 bytes of the SHA-256 of the key followed by `parts`.
    pub(super) fn signature(&self, parts: &[&[u8]]) -> [u8; 6] {
        let mut hash = Sha256::new();
        hash.update(self.0);
        for part in parts {
            hash.update(part);
        }
        let [b0, b1, b2, b3, b4, b5, ..] = <[u8; 32]>::from(hash.finalize());
        [b0, b1, b2, b3, b4, b5]
    }
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SigningKey(..)")
    }
}

/// Timestamp of a signature: units of 10 us since 2015-01-01 00:00 UTC, 48 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct SigningTime(u64);

impl SigningTime {
    const MAX: u64 = (1 << 48) - 1;
    const PER_SECOND: u64 = 100_000;
    /// 2015-01-01 00:00 UTC as Unix time, s.
    const EPOCH_UNIX_S: u64 = 1_420_070_400;

    /// From a Unix time, microseconds. Times before 2015 become 0, the state of a clock that was never set.
    #[must_use]
    pub const fn from_unix_micros(unix_us: u64) -> SigningTime {
        SigningTime::from_wire(unix_us.saturating_sub(SigningTime::EPOCH_UNIX_S * 1_000_000) / 10)
    }

    /// From units of 10 us; more than 48 bits are cut to the largest value.
    #[must_use]
    pub const fn from_wire(units: u64) -> SigningTime {
        SigningTime(if units > SigningTime::MAX { SigningTime::MAX } else { units })
    }

    /// Units of 10 us.
    #[must_use]
    pub const fn to_wire(self) -> u64 {
        self.0
    }

    /// `seconds` later.
    #[must_use]
    pub const fn plus_seconds(self, seconds: u64) -> SigningTime {
        SigningTime::from_wire(self.0.saturating_add(seconds.saturating_mul(SigningTime::PER_SECOND)))
    }

    /// The next timestamp.
    pub(super) const fn next(self) -> SigningTime {
        SigningTime::from_wire(self.0.saturating_add(1))
    }

    /// The six bytes of a signature.
    pub(super) const fn bytes(self) -> [u8; 6] {
        let [b0, b1, b2, b3, b4, b5, ..] = self.0.to_le_bytes();
        [b0, b1, b2, b3, b4, b5]
    }

    /// From the six bytes of a signature.
    pub(super) const fn from_bytes([b0, b1, b2, b3, b4, b5]: [u8; 6]) -> SigningTime {
        SigningTime(u64::from_le_bytes([b0, b1, b2, b3, b4, b5, 0, 0]))
    }
}
