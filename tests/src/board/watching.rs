//! Frames on the lines of a flight.

use gleaner_harness::Journal;
use gleaner_link::{Frame, FrameDecoder};
use gleaner_units::Instant;

/// `NAMED_VALUE_FLOAT`.
const NAMED_VALUE_FLOAT: u32 = 251;

/// One frame and its time since the autopilot's first boot.
#[derive(Debug)]
pub struct Heard {
    /// Time.
    pub at: Instant,
    /// The frame.
    pub frame: Frame,
}

/// All frames of this component with this message, in order.
#[must_use]
pub fn heard(journal: &Journal, component: u8, message_id: u32) -> Vec<Heard> {
    let mut found = Vec::new();
    for (at, bytes) in journal.frames() {
        let frame = FrameDecoder::new().read(&mut &*bytes);
        let wanted = |frame: &Frame| frame.sender.component == component && frame.message_id == message_id;
        found.extend(frame.filter(wanted).map(|frame| Heard { at, frame }));
    }
    found
}

/// The values that a component has sent under this name.
#[must_use]
pub fn named_values(journal: &Journal, component: u8, name: &str) -> Vec<f32> {
    let frames = heard(journal, component, NAMED_VALUE_FLOAT);
    let value = |heard: &Heard| {
        // Time, value, name of 10 characters; trailing zeros do not travel.
        let mut payload = [0; 18];
        let payload_sent = heard.frame.payload();
        payload.get_mut(..payload_sent.len())?.copy_from_slice(payload_sent);
        let text = payload[8..].split(|&byte| byte == 0).next()?;
        (text == name.as_bytes())
            .then(|| f32::from_le_bytes([payload[4], payload[5], payload[6], payload[7]]))
    };
    frames.iter().filter_map(value).collect()
}
