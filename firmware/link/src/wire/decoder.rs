//! Finds frames in a stream of bytes.

use super::candidate::{Candidate, Rejected, is_magic, judge};
use super::frame::{Frame, MAX_FRAME_BYTES};

/// Room for one incomplete frame and as much again to read ahead.
const CAPACITY: usize = 2 * MAX_FRAME_BYTES;

/// Counters of received bytes, by kind. They stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecodeStats {
    /// Frames handed out.
    pub frames: u32,
    /// Frames handed out that carry a signature.
    pub signed: u32,
    /// Candidates with a wrong checksum: damaged frames, and garbage that looks like a frame.
    pub bad_crc: u32,
    /// Candidates with an id outside the dialect (MAVLink 1: outside what we need). Not an error: newer senders
    /// have newer messages.
    pub unknown_message: u32,
    /// Candidates with an incompatibility flag that we do not know.
    pub incompatible: u32,
    /// Bytes that belong to no frame handed out.
    pub garbage_bytes: u32,
}

/// Finds frames in a stream of bytes.
///
/// # A payload is data
/// The payload of an unknown frame may contain recorded frames: a log download, a tunnel, a message newer than the
/// dialect. In an undamaged stream the decoder never returns them:
/// - Directly after a frame, or at the start of a datagram, a MAVLink 2 frame with an unknown id is skipped by the length
///   in its header.
/// - Any other rejected header is skipped by its length if another frame begins there. Otherwise the search continues at
///   its second byte.
///
/// Noise on a line therefore costs at most the frames that begin within twice [`MAX_FRAME_BYTES`] bytes after it.
///
/// # Cost
/// Linear in the bytes for clean input. Garbage made of magic bytes costs one checksum per magic byte.
#[derive(Clone, Debug)]
pub struct FrameDecoder {
    buffer: [u8; CAPACITY],
    start: usize,
    end: usize,
    /// Where the newest bytes begin.
    newest: usize,
    /// Bytes of a skipped frame that have not arrived yet.
    to_skip: usize,
    /// Whether the next byte is where a frame must begin.
    in_order: bool,
    stats: DecodeStats,
}

impl Default for FrameDecoder {
    fn default() -> FrameDecoder {
        FrameDecoder::new()
    }
}

impl FrameDecoder {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new() -> FrameDecoder {
        FrameDecoder {
            buffer: [0; CAPACITY],
            start: 0,
            end: 0,
            newest: 0,
            to_skip: 0,
            in_order: false,
            stats: DecodeStats {
                frames: 0,
                signed: 0,
                bad_crc: 0,
                unknown_message: 0,
                incompatible: 0,
                garbage_bytes: 0,
            },
        }
    }

    /// Says that the next bytes begin a datagram. What is left of the one before is dropped: a frame never
    /// continues in the next datagram.
    pub fn begin_datagram(&mut self) {
        let left = self.end.saturating_sub(self.start);
        self.stats.garbage_bytes = self.stats.garbage_bytes.saturating_add(left as u32);
        (self.start, self.end, self.newest, self.to_skip, self.in_order) = (0, 0, 0, 0, true);
    }

    /// The next frame in what is left of `bytes`. `None` when all of them are taken in and more are needed.
    ///
    /// ```
    /// # use gleaner_link::FrameDecoder;
    /// # fn handle(frame: &gleaner_link::Frame) {}
    /// # let (mut decoder, received) = (FrameDecoder::new(), [0xFD, 1, 2]);
    /// let mut bytes = &received[..];
    /// while let Some(frame) = decoder.read(&mut bytes) {
    ///     handle(&frame);
    /// }
    /// ```
    pub fn read(&mut self, bytes: &mut &[u8]) -> Option<Frame> {
        loop {
            if let Some(frame) = self.next_frame() {
                return Some(frame);
            }
            if bytes.is_empty() {
                return None;
            }
            let taken = self.push(bytes);
            *bytes = bytes.get(taken..).unwrap_or(&[]);
        }
    }

    /// Takes in bytes and returns how many. Less than all when the buffer is full; after
    /// [`FrameDecoder::next_frame`] has returned `None` there is always room for some.
    fn push(&mut self, bytes: &[u8]) -> usize {
        let skipped = self.to_skip.min(bytes.len());
        self.to_skip -= skipped;
        self.count_garbage(skipped);
        let bytes = bytes.get(skipped..).unwrap_or(&[]);
        self.move_to_front();
        let room = self.buffer.get_mut(self.end..).unwrap_or(&mut []);
        let taken = room.len().min(bytes.len());
        for (slot, byte) in room.iter_mut().zip(bytes) {
            *slot = *byte;
        }
        self.newest = self.end;
        self.end += taken;
        skipped + taken
    }

    /// The next frame in the buffer, `None` when more bytes are needed.
    fn next_frame(&mut self) -> Option<Frame> {
        loop {
            let held = self.buffer.get(self.start..self.end)?;
            match judge(held) {
                Candidate::Incomplete => return None,
                Candidate::Garbage(count) => {
                    self.drop_bytes(count);
                    self.in_order = false;
                }
                Candidate::Rejected { reason, length } => {
                    let next_begins = held.get(length).map(|&byte| is_magic(byte));
                    if !self.pass(reason, length, next_begins) {
                        return None;
                    }
                }
                Candidate::Packet(packet) => {
                    let end = self.start + packet.length;
                    let frame = packet.frame(held, end <= self.newest);
                    self.start = end;
                    self.in_order = true;
                    count(&mut self.stats.frames);
                    if frame.signature.is_some() {
                        count(&mut self.stats.signed);
                    }
                    return Some(frame);
                }
            }
        }
    }

    /// The counters.
    #[must_use]
    pub const fn stats(&self) -> DecodeStats {
        self.stats
    }

    /// Leaves a rejected candidate behind. `next_begins`: whether a frame begins where this one ends, `None` when
    /// that byte has not arrived. Returns false when that byte is needed.
    fn pass(&mut self, reason: Rejected, length: usize, next_begins: Option<bool>) -> bool {
        let believed = self.in_order && reason == Rejected::Unknown;
        let skip = match next_begins {
            _ if believed => true,
            Some(begins) => begins,
            None => return false,
        };
        count(match reason {
            Rejected::Checksum => &mut self.stats.bad_crc,
            Rejected::Unknown | Rejected::UnknownV1 => &mut self.stats.unknown_message,
            Rejected::Incompatible => &mut self.stats.incompatible,
        });
        if skip {
            let held = self.end.saturating_sub(self.start);
            self.to_skip = length.saturating_sub(held);
            self.drop_bytes(length.min(held));
            self.in_order = believed;
        } else {
            self.drop_bytes(1);
            self.in_order = false;
        }
        true
    }

    fn drop_bytes(&mut self, count: usize) {
        self.start += count;
        self.count_garbage(count);
    }

    fn count_garbage(&mut self, bytes: usize) {
        self.stats.garbage_bytes = self.stats.garbage_bytes.saturating_add(bytes as u32);
    }

    fn move_to_front(&mut self) {
        if self.start == 0 {
            return;
        }
        let held = self.end.saturating_sub(self.start);
        for at in 0..held {
            let byte = self.buffer.get(self.start + at).copied().unwrap_or(0);
            if let Some(slot) = self.buffer.get_mut(at) {
                *slot = byte;
            }
        }
        self.start = 0;
        self.end = held;
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
