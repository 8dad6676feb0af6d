//! What is sent unasked at a rate: nothing, until somebody asks.

use gleaner_units::{Duration, Instant};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;

/// Messages that ArduCopter sends at a rate or on request.
pub(crate) const STREAMABLE: [u32; 15] = [
    dialect::SYS_STATUS_DATA::ID,
    dialect::SYSTEM_TIME_DATA::ID,
    dialect::GPS_RAW_INT_DATA::ID,
    dialect::ATTITUDE_DATA::ID,
    dialect::LOCAL_POSITION_NED_DATA::ID,
    dialect::GLOBAL_POSITION_INT_DATA::ID,
    dialect::GPS_GLOBAL_ORIGIN_DATA::ID,
    dialect::NAV_CONTROLLER_OUTPUT_DATA::ID,
    dialect::RC_CHANNELS_DATA::ID,
    dialect::VFR_HUD_DATA::ID,
    dialect::POSITION_TARGET_LOCAL_NED_DATA::ID,
    dialect::BATTERY_STATUS_DATA::ID,
    dialect::EKF_STATUS_REPORT_DATA::ID,
    dialect::HOME_POSITION_DATA::ID,
    dialect::EXTENDED_SYS_STATE_DATA::ID,
];

#[derive(Clone, Copy, Debug)]
struct Stream {
    message_id: u32,
    interval: Duration,
    next_at: Instant,
}

/// The streams of one link.
#[derive(Clone, Debug, Default)]
pub(crate) struct Streams(Vec<Stream>);

impl Streams {
    /// `MAV_CMD_SET_MESSAGE_INTERVAL`: microseconds between two, 0 for the default rate (which is none), below 0 for
    /// off. Whether the message is known.
    pub fn set(&mut self, now: Instant, message_id: u32, interval_us: f32) -> bool {
        if !STREAMABLE.contains(&message_id) {
            return false;
        }
        self.0.retain(|stream| stream.message_id != message_id);
        // Written so that NaN is off.
        if interval_us >= 1.0 {
            let interval = Duration::from_micros(interval_us as u64);
            self.0.push(Stream { message_id, interval, next_at: now + interval });
        }
        true
    }

    /// The next message that is due; call until `None`.
    pub fn due(&mut self, now: Instant) -> Option<u32> {
        let stream = self.0.iter_mut().find(|stream| stream.next_at <= now)?;
        // The next time follows from the last one, not from now: the rate is exact whatever the step.
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
    fn the_rate_is_exact_whatever_the_step() {
        let mut streams = Streams::default();
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
