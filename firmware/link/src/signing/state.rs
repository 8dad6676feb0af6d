//! What must survive a restart.

use super::key::SigningTime;
use crate::address::Address;
use crate::wire::checksum::checksum;
use core::fmt;
use heapless::Vec;

/// The last accepted timestamp of one stream: a sender and its link id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stream {
    pub sender: Address,
    pub link_id: u8,
    pub last: SigningTime,
}

/// Timestamps of a port: the newest that was sent or accepted, and the last accepted one of each stream.
///
/// A frame that was accepted after the state was last stored can be replayed once after a restart, unless it is more
/// than a minute old. So store the state often; once a minute is the least (MAVLink guide).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SigningState {
    pub(super) newest: SigningTime,
    pub(super) streams: Vec<Stream, { SigningState::STREAMS }>,
}

/// Why bytes are no stored state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateError {
    /// Another length than a state has.
    Length,
    /// Another format version.
    Version(u8),
    /// A checksum that does not match: the bytes are damaged.
    Checksum,
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StateError::Length => f.write_str("signing timestamps: wrong length"),
            StateError::Version(version) => write!(f, "signing timestamps: unknown version {version}"),
            StateError::Checksum => f.write_str("signing timestamps: damaged"),
        }
    }
}

impl core::error::Error for StateError {}

/// A stored state: version (1), newest (6), number of streams (1), per stream system, component, link id (3) and
/// last timestamp (6), CRC-16/MCRF4XX of all that (2).
pub type StateBytes = Vec<u8, { 8 + 9 * SigningState::STREAMS + 2 }>;

const VERSION: u8 = 1;

impl SigningState {
    /// Streams that are remembered. A frame of one more is refused: forgetting a stream would allow its replay.
    pub const STREAMS: usize = 32;

    /// The bytes to store.
    #[must_use]
    pub fn to_bytes(&self) -> StateBytes {
        let mut bytes = StateBytes::new();
        // `StateBytes` has room for all streams, so nothing is cut off here.
        let mut put = |part: &[u8]| {
            let _ = bytes.extend_from_slice(part);
        };
        put(&[VERSION]);
        put(&self.newest.bytes());
        put(&[self.streams.len() as u8]);
        for stream in &self.streams {
            put(&[stream.sender.system, stream.sender.component, stream.link_id]);
            put(&stream.last.bytes());
        }
        let sum = checksum(&bytes, 0);
        let _ = bytes.extend_from_slice(&sum.to_le_bytes());
        bytes
    }

    /// Reads stored bytes.
    ///
    /// # Errors
    /// See [`StateError`]. Do not go on without a state then: replays would be accepted.
    pub fn from_bytes(bytes: &[u8]) -> Result<SigningState, StateError> {
        let (body, &sum) = bytes.split_last_chunk::<2>().ok_or(StateError::Length)?;
        let (&[version, n0, n1, n2, n3, n4, n5, count], rest) =
            body.split_first_chunk::<8>().ok_or(StateError::Length)?;
        if version != VERSION {
            return Err(StateError::Version(version));
        }
        if rest.len() != 9 * usize::from(count) || usize::from(count) > SigningState::STREAMS {
            return Err(StateError::Length);
        }
        if checksum(body, 0) != u16::from_le_bytes(sum) {
            return Err(StateError::Checksum);
        }
        let newest = SigningTime::from_bytes([n0, n1, n2, n3, n4, n5]);
        let mut state = SigningState { newest, streams: Vec::new() };
        let (entries, _) = rest.as_chunks::<9>();
        for &[system, component, link_id, t0, t1, t2, t3, t4, t5] in entries {
            let last = SigningTime::from_bytes([t0, t1, t2, t3, t4, t5]);
            // It fits: the count was checked above.
            let _ = state.streams.push(Stream { sender: Address::new(system, component), link_id, last });
        }
        Ok(state)
    }
}
