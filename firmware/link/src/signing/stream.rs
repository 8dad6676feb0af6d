//! Signing and verifying the frames of one port.

use super::key::{SigningKey, SigningTime};
use super::state::{SigningState, Stream};
use crate::wire::checksum::{checksum, extra_crc};
use crate::wire::frame::{CHECKSUM, FLAG_SIGNED, Frame, HEADER_V2, MAGIC_V2, MAX_FRAME_BYTES, WireVersion};
use heapless::Vec;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{RADIO_STATUS_DATA, SETUP_SIGNING_DATA};

/// A signed frame.
pub type SignedFrameBytes = Vec<u8, MAX_FRAME_BYTES>;

/// Why a frame was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SigningFault {
    /// No signature, on a port that needs one.
    Unsigned,
    /// The signature does not match: another key, or an altered frame.
    Signature,
    /// The timestamp is not newer than the last of its stream: a replay, or a late frame.
    Replayed,
    /// The first frame of a stream is more than a minute older than our timestamp.
    Old,
    /// One stream more than [`SigningState::STREAMS`].
    TooManyStreams,
    /// `SETUP_SIGNING`: keys are not set over the air.
    Setup,
}

/// Counters of a signed port. They stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SigningStats {
    /// Frames accepted, `RADIO_STATUS` included.
    pub accepted: u32,
    /// Frames signed.
    pub signed: u32,
    /// See [`SigningFault::Unsigned`].
    pub unsigned: u32,
    /// See [`SigningFault::Signature`].
    pub wrong: u32,
    /// See [`SigningFault::Replayed`].
    pub replayed: u32,
    /// See [`SigningFault::Old`].
    pub old: u32,
    /// See [`SigningFault::TooManyStreams`].
    pub too_many_streams: u32,
    /// See [`SigningFault::Setup`].
    pub setup: u32,
}

/// Whether a router may pass this message on. `SETUP_SIGNING` holds a secret key (MAVLink guide: it "must not be
/// forwarded").
#[must_use]
pub const fn may_forward(message_id: u32) -> bool {
    message_id != SETUP_SIGNING_DATA::ID
}

/// Signs and verifies the frames of one port.
#[derive(Clone, Debug)]
pub struct Signing {
    key: SigningKey,
    link_id: u8,
    state: SigningState,
    stats: SigningStats,
}

impl Signing {
    /// How far the first frame of a stream may be behind our timestamp, s.
    const MAX_AGE_S: u64 = 60;
    /// What a restart adds to the stored timestamp, s: more than was sent since it was stored.
    const RESTART_S: u64 = 60;

    /// Signing with `key`. `link_id` names the port in our signatures. `wall` is the time of day if the computer has
    /// one, else [`SigningTime::default`]. `stored` is the state that the last run stored, at most a minute before
    /// its end.
    #[must_use]
    pub fn new(key: SigningKey, link_id: u8, wall: SigningTime, stored: Option<SigningState>) -> Signing {
        let mut state = stored.unwrap_or_default();
        if state.newest != SigningTime::default() {
            state.newest = state.newest.plus_seconds(Signing::RESTART_S);
        }
        state.newest = state.newest.max(wall);
        Signing { key, link_id, state, stats: SigningStats::default() }
    }

    /// Advances our timestamp to the time of day; an earlier time changes nothing. Call it before signing or
    /// checking, as often as is convenient.
    pub fn set_clock(&mut self, wall: SigningTime) {
        self.state.newest = self.state.newest.max(wall);
    }

    /// The state to store.
    #[must_use]
    pub const fn state(&self) -> &SigningState {
        &self.state
    }

    /// The counters.
    #[must_use]
    pub const fn stats(&self) -> SigningStats {
        self.stats
    }

    /// Signs one unsigned MAVLink 2 frame. `None` for anything else, MAVLink 1 included, which has no signatures:
    /// such bytes must not be sent on this port.
    #[must_use]
    pub fn sign(&mut self, frame: &[u8]) -> Option<SignedFrameBytes> {
        let &[magic, length, flags, ..] = frame else { return None };
        let checked = HEADER_V2 + usize::from(length);
        if magic != MAGIC_V2 || flags != 0 || frame.len() != checked + CHECKSUM {
            return None;
        }
        let (body, sum) = frame.split_at_checked(checked)?;
        // From frame and checksum, so that messages outside the dialect can be signed as well.
        let extra = extra_crc(body.get(1..)?, u16::from_le_bytes(*sum.first_chunk()?))?;
        let mut signed = SignedFrameBytes::from_slice(body).ok()?;
        *signed.get_mut(2)? |= FLAG_SIGNED;
        let sum = checksum(signed.get(1..)?, extra);
        signed.extend_from_slice(&sum.to_le_bytes()).ok()?;
        self.state.newest = self.state.newest.next();
        let time = self.state.newest.bytes();
        let signature = self.key.signature(&[&signed, &[self.link_id], &time]);
        for part in [[self.link_id].as_slice(), &time, &signature] {
            signed.extend_from_slice(part).ok()?;
        }
        count(&mut self.stats.signed);
        Some(signed)
    }

    /// Checks one received frame.
    ///
    /// # Errors
    /// See [`SigningFault`]: drop the frame. The reason is counted.
    pub fn check(&mut self, frame: &Frame) -> Result<(), SigningFault> {
        let checked = self.judge(frame);
        count(match checked {
            Ok(()) => &mut self.stats.accepted,
            Err(SigningFault::Unsigned) => &mut self.stats.unsigned,
            Err(SigningFault::Signature) => &mut self.stats.wrong,
            Err(SigningFault::Replayed) => &mut self.stats.replayed,
            Err(SigningFault::Old) => &mut self.stats.old,
            Err(SigningFault::TooManyStreams) => &mut self.stats.too_many_streams,
            Err(SigningFault::Setup) => &mut self.stats.setup,
        });
        checked
    }

    fn judge(&mut self, frame: &Frame) -> Result<(), SigningFault> {
        if frame.message_id == SETUP_SIGNING_DATA::ID {
            return Err(SigningFault::Setup);
        }
        let Some(signature) = frame.signature.filter(|_| frame.version == WireVersion::V2) else {
            // Telemetry radios insert it themselves and have no key (MAVLink guide, "Accepting Unsigned Packets").
            let is_radio = frame.message_id == RADIO_STATUS_DATA::ID;
            return if is_radio { Ok(()) } else { Err(SigningFault::Unsigned) };
        };
        let [link_id, t0, t1, t2, t3, t4, t5, sent @ ..] = signature;
        let time_bytes = [t0, t1, t2, t3, t4, t5];
        let (header, checksum) = (frame.header_v2(), frame.checksum.to_le_bytes());
        let ours = self.key.signature(&[&header, frame.payload(), &checksum, &[link_id], &time_bytes]);
        // All bytes are compared, so that the time taken does not depend on how many match.
        if ours.iter().zip(sent).fold(0, |differences, (ours, sent)| differences | (ours ^ sent)) != 0 {
            return Err(SigningFault::Signature);
        }
        let time = SigningTime::from_bytes(time_bytes);
        self.admit(frame, link_id, time)?;
        self.state.newest = self.state.newest.max(time);
        Ok(())
    }

    /// Whether the timestamp is newer than the last of its stream, which it becomes.
    fn admit(&mut self, frame: &Frame, link_id: u8, time: SigningTime) -> Result<(), SigningFault> {
        let mut streams = self.state.streams.iter_mut();
        if let Some(stream) =
            streams.find(|stream| stream.sender == frame.sender && stream.link_id == link_id)
        {
            if time <= stream.last {
                return Err(SigningFault::Replayed);
            }
            stream.last = time;
            return Ok(());
        }
        if time.plus_seconds(Signing::MAX_AGE_S) < self.state.newest {
            return Err(SigningFault::Old);
        }
        let stream = Stream { sender: frame.sender, link_id, last: time };
        self.state.streams.push(stream).map_err(|_| SigningFault::TooManyStreams)
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
