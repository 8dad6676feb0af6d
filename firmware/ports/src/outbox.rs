//! Bytes that a stream did not take yet.

use std::collections::VecDeque;
use std::io;

/// Bytes kept per stream while its peer is slow: several seconds of telemetry. Beyond that frames are dropped,
/// since old setpoints are worth less than new ones.
pub const OUTBOX_BYTES: usize = 16 * 1024;

/// A bounded queue of whole frames, of which the first may have been sent in part.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    bytes: VecDeque<u8>,
}

impl Outbox {
    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Forgets what was meant for a peer that is gone.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Takes the frame and sends what the stream takes now. `false`: the frame was dropped whole, for want of
    /// room.
    ///
    /// # Errors
    /// The stream's own, other than "would block".
    pub(crate) fn send(&mut self, frame: &[u8], stream: &mut impl io::Write) -> io::Result<bool> {
        self.flush(stream)?;
        if self.bytes.len() + frame.len() > OUTBOX_BYTES {
            return Ok(false);
        }
        self.bytes.extend(frame);
        self.flush(stream)?;
        Ok(true)
    }

    /// Sends what the stream takes now.
    ///
    /// # Errors
    /// The stream's own, other than "would block".
    pub(crate) fn flush(&mut self, stream: &mut impl io::Write) -> io::Result<()> {
        while !self.bytes.is_empty() {
            match stream.write(self.bytes.as_slices().0) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(sent) => drop(self.bytes.drain(..sent)),
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

    /// Takes `room` bytes, then would block.
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
        assert!(outbox.send(b"abcde", &mut stream).unwrap());
        assert_eq!(stream.taken, b"abc");
        let large = [b'x'; OUTBOX_BYTES - 1];
        assert!(!outbox.send(&large, &mut stream).unwrap(), "two bytes wait, so this one has no room");
        assert!(outbox.send(b"fg", &mut stream).unwrap());
        stream.room = 100;
        outbox.flush(&mut stream).unwrap();
        assert_eq!(stream.taken, b"abcdefg");
        assert!(outbox.is_empty());
    }
}
