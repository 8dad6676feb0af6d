//! Messages that are sent at a rate on one link.

use gleaner_units::{Duration, Instant};

/// Message ids that an autopilot can stream.
pub(super) type Supported = &'static [u32];

#[derive(Clone, Copy, Debug)]
struct Stream {
    message_id: u32,
    interval: Duration,
    next_at: Instant,
}

/// The streams of one link.
#[derive(Clone, Debug)]
pub(super) struct Streams {
    supported: Supported,
    active: Vec<Stream>,
}

impl Streams {
    pub const fn new(supported: Supported) -> Streams {
        Streams { supported, active: Vec::new() }
    }

    /// `MAV_CMD_SET_MESSAGE_INTERVAL`: microseconds between two messages; 0 and below stop the stream. Whether the
    /// message can be streamed.
    pub fn set(&mut self, now: Instant, message_id: u32, interval_us: f32) -> bool {
        if !self.supported.contains(&message_id) {
            return false;
        }
        self.active.retain(|stream| stream.message_id != message_id);
        // False for NaN.
        if interval_us >= 1.0 {
            let interval = Duration::from_micros(interval_us as u64);
            self.active.push(Stream { message_id, interval, next_at: now + interval });
        }
        true
    }

    /// Sets the same interval for every message.
    pub fn set_all(&mut self, now: Instant, interval_us: f32) {
        for &message_id in self.supported {
            self.set(now, message_id, interval_us);
        }
    }

    /// The next message that is due; call until `None`.
    pub fn due(&mut self, now: Instant) -> Option<u32> {
        let stream = self.active.iter_mut().find(|stream| stream.next_at <= now)?;
        // Counted from the last due time, not from now: the rate is exact for every step length.
        stream.next_at = stream.next_at + stream.interval;
        if stream.next_at <= now {
            stream.next_at = now + stream.interval;
        }
        Some(stream.message_id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_exact_for_every_step_length() {
        let mut streams = Streams::new(&[32]);
        assert!(streams.set(Instant::ZERO, 32, 1e6 / 7.0));
        assert!(!streams.set(Instant::ZERO, 9999, 1e6));
        let mut sent = 0;
        for step in 1..=500 {
            while streams.due(Instant::from_millis(step * 20)).is_some() {
                sent += 1;
            }
        }
        assert_eq!(sent, 70);
        assert!(streams.set(Instant::from_millis(10_000), 32, -1.0));
        assert_eq!(streams.due(Instant::from_millis(20_000)), None);
    }
}
