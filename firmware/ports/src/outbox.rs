//! Bytes that a stream has not accepted yet.

use std::collections::VecDeque;
use std::io;

/// Bytes kept per stream while its peer is slow: several seconds of telemetry. Beyond that frames are dropped,
/// because an old setpoint is worth less than a new one.
pub const OUTBOX_BYTES: usize = 16 * 1024;

/// One frame that waits.
#[derive(Debug)]
struct Waiting {
    bytes: Vec<u8>,
    revocable: bool,
}

/// A bounded queue of whole frames, of which the first may have been sent in part.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    frames: VecDeque<Waiting>,
    /// Bytes of the first frame that were sent.
    sent: usize,
    /// Bytes of all frames.
    held: usize,
}

impl Outbox {
    pub(crate) fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Drops all frames: their peer is gone.
    pub(crate) fn clear(&mut self) {
        *self = Outbox::default();
    }

    /// Drops the frames that were queued as revocable; returns how many. The rest of a frame that was sent in part
    /// is dropped too: its receiver discards the part by its checksum.
    pub(crate) fn revoke(&mut self) -> usize {
        let before = self.frames.len();
        if self.frames.front().is_some_and(|first| first.revocable) {
            self.sent = 0;
        }
        self.frames.retain(|frame| !frame.revocable);
        self.held = self.frames.iter().map(|frame| frame.bytes.len()).sum();
        before - self.frames.len()
    }

    /// Queues the frame and sends what the stream accepts now. `false`: the frame was dropped whole because the
    /// queue is full.
    ///
    /// # Errors
    /// The stream's own, other than "would block".
    pub(crate) fn send(
        &mut self,
        frame: &[u8],
        revocable: bool,
        stream: &mut impl io::Write,
    ) -> io::Result<bool> {
        self.flush(stream)?;
        if self.held - self.sent + frame.len() > OUTBOX_BYTES {
            return Ok(false);
        }
        if frame.is_empty() {
            return Ok(true);
        }
        self.held += frame.len();
        self.frames.push_back(Waiting { bytes: frame.to_vec(), revocable });
        self.flush(stream)?;
        Ok(true)
    }

    /// Sends what the stream accepts now.
    ///
    /// # Errors
    /// The stream's own, other than "would block".
    pub(crate) fn flush(&mut self, stream: &mut impl io::Write) -> io::Result<()> {
        while let Some(first) = self.frames.front() {
            match stream.write(first.bytes.get(self.sent..).unwrap_or(&[])) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(sent) => {
                    self.sent += sent;
                    if self.sent >= first.bytes.len() {
                        self.held -= first.bytes.len();
                        self.sent = 0;
                        self.frames.pop_front();
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Accepts `room` bytes, then would block.
    struct Narrow {
        room: usize,
        taken: Vec<u8>,
    }

    impl io::Write for Narrow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let sent = bytes.len().min(self.room);
            if sent == 0 {
                return Err(io::ErrorKind::WouldBlock.into());
            }
            self.room -= sent;
            self.taken.extend(&bytes[..sent]);
            Ok(sent)
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn frames_are_dropped_whole_and_the_rest_stays_in_order() {
        let mut outbox = Outbox::default();
        let mut stream = Narrow { room: 3, taken: Vec::new() };
        assert!(outbox.send(b"abcde", false, &mut stream).unwrap());
        assert_eq!(stream.taken, b"abc");
        let large = [b'x'; OUTBOX_BYTES - 1];
        assert!(!outbox.send(&large, false, &mut stream).unwrap(), "two bytes wait, so this one has no room");
        assert!(outbox.send(b"fg", false, &mut stream).unwrap());
        stream.room = 100;
        outbox.flush(&mut stream).unwrap();
        assert_eq!(stream.taken, b"abcdefg");
        assert!(outbox.is_empty());
    }

    #[test]
    fn revoked_frames_are_not_sent() {
        let mut outbox = Outbox::default();
        let mut stream = Narrow { room: 1, taken: Vec::new() };
        for (frame, revocable) in [(b"AAA", true), (b"bbb", false), (b"CCC", true), (b"ddd", false)] {
            assert!(outbox.send(frame, revocable, &mut stream).unwrap());
        }
        assert_eq!(outbox.revoke(), 2);
        stream.room = 100;
        outbox.flush(&mut stream).unwrap();
        assert_eq!(stream.taken, b"Abbbddd", "one byte had left before");
        assert_eq!(outbox.held, 0);
        assert_eq!(outbox.revoke(), 0);
    }

    #[test]
    fn a_frame_sent_in_part_is_finished_after_a_revocation_of_others() {
        let mut outbox = Outbox::default();
        let mut stream = Narrow { room: 2, taken: Vec::new() };
        outbox.send(b"bbb", false, &mut stream).unwrap();
        outbox.send(b"CCC", true, &mut stream).unwrap();
        assert_eq!(outbox.revoke(), 1);
        stream.room = 100;
        outbox.flush(&mut stream).unwrap();
        assert_eq!(stream.taken, b"bbb");
    }
}
