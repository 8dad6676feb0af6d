//! Status texts: split into chunks, limited in rate, the most severe kept.

use crate::message::Severity;
use crate::wire::outgoing::{Outgoing, Priority};
use crate::wire::packet::Packet;
use core::fmt::{self, Write};
use gleaner_units::{Duration, Instant};
use heapless::{Deque, String, Vec};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::STATUSTEXT_DATA;

/// Bytes of one `STATUSTEXT`.
const CHUNK: usize = 50;
/// Longest text; the rest is cut off.
const LONGEST: usize = 3 * CHUNK;

#[derive(Debug)]
struct Text {
    severity: Severity,
    text: String<LONGEST>,
}

/// Texts that wait: at most ten chunks a second leave.
#[derive(Debug, Default)]
pub(crate) struct Texts {
    waiting: Deque<Text, 8>,
    /// Chunks of the first text that have left.
    chunks_sent: u8,
    /// Id that joins the chunks of one text; 0 is for texts of one chunk.
    last_id: u16,
    next_at: Instant,
    pub dropped: u32,
}

/// Limits the texts that senders cause who are no operators: at ten a second these would displace the operator's own.
#[derive(Debug, Default)]
pub(crate) struct Strangers {
    window_ends: Instant,
    said: u8,
    unsaid: u32,
}

impl Strangers {
    const WINDOW: Duration = Duration::from_secs(10);
    const TEXTS: u8 = 3;

    /// Whether a text may be said now, and how many were not said since the last one.
    pub fn admit(&mut self, now: Instant) -> Option<u32> {
        if now >= self.window_ends {
            (self.window_ends, self.said) = (now + Strangers::WINDOW, 0);
        }
        if self.said < Strangers::TEXTS {
            self.said += 1;
            return Some(core::mem::take(&mut self.unsaid));
        }
        self.unsaid = self.unsaid.saturating_add(1);
        None
    }
}

/// Writes as much as fits.
struct Truncated<'a>(&'a mut String<LONGEST>);

impl Write for Truncated<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            self.0.push(character).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

impl Texts {
    const INTERVAL: Duration = Duration::from_millis(100);

    /// Queues a text. When the queue is full, the least severe text is dropped: a waiting one, or this one.
    pub fn say(&mut self, severity: Severity, text: fmt::Arguments<'_>) {
        let mut held = String::new();
        let _ = Truncated(&mut held).write_fmt(text);
        if self.waiting.is_full() {
            self.dropped = self.dropped.saturating_add(1);
            if !self.make_room(severity) {
                return;
            }
        }
        let _ = self.waiting.push_back(Text { severity, text: held });
    }

    /// Drops the newest of the least severe waiting texts if it is less severe than `severity`. Never the first, of
    /// which a part may have left.
    fn make_room(&mut self, severity: Severity) -> bool {
        let least = self.waiting.iter().skip(1).map(|text| text.severity).max();
        let Some(least) = least.filter(|&least| least > severity) else { return false };
        let Some(last) = self.waiting.iter().rposition(|text| text.severity == least) else { return false };
        // Rotates the queue once without that text: the linker cannot prove that `Deque::retain` does not panic.
        for at in 0..self.waiting.len() {
            if let Some(text) = self.waiting.pop_front().filter(|_| at != last) {
                let _ = self.waiting.push_back(text);
            }
        }
        true
    }

    /// Sends the next chunk if it is due and there is room.
    pub fn poll(&mut self, now: Instant, out: &mut Outgoing) {
        if now < self.next_at || !out.has_bulk_room() {
            return;
        }
        let Some(first) = self.waiting.front() else { return };
        let is_long = first.text.len() > CHUNK;
        if is_long && self.chunks_sent == 0 {
            self.last_id = self.last_id.checked_add(1).unwrap_or(1);
        }
        let id = if is_long { self.last_id } else { 0 };
        if let Some(packet) = chunk(first, id, self.chunks_sent) {
            out.push(Priority::Bulk, packet);
        }
        self.next_at = now + Texts::INTERVAL;
        self.chunks_sent += 1;
        // A full chunk has no NUL, so an empty chunk ends the text.
        let ended = !is_long || usize::from(self.chunks_sent) * CHUNK > first.text.len();
        if ended {
            let _ = self.waiting.pop_front();
            self.chunks_sent = 0;
        }
    }
}

/// One `STATUSTEXT`: severity, text, id, chunk number.
fn chunk(text: &Text, id: u16, chunk_seq: u8) -> Option<Packet> {
    let rest = text.text.as_bytes().iter().skip(usize::from(chunk_seq) * CHUNK);
    let padded = rest.copied().chain(core::iter::repeat(0)).take(CHUNK);
    let [id_low, id_high] = id.to_le_bytes();
    let mut payload = Vec::<u8, { CHUNK + 4 }>::new();
    for byte in [text.severity as u8].into_iter().chain(padded).chain([id_low, id_high, chunk_seq]) {
        // It fits: as many bytes as were counted above.
        let _ = payload.push(byte);
    }
    Packet::from_payload(STATUSTEXT_DATA::ID, STATUSTEXT_DATA::EXTRA_CRC, &payload)
}
