//! The main loop of every board: bytes in, a poll every 20 ms, bytes out.

use crate::{Journal, PortStats};
use embedded_io::{Read, ReadReady, Write, WriteReady};
use gleaner_link::{MAX_FRAME_BYTES, Severity};
use gleaner_pilot::{Onboard, POLL_INTERVAL, State};
use gleaner_policy::{Policy, Timed};
use gleaner_units::{Duration, Instant};

/// Bytes taken from one port in one pass: a flood on one port must not starve the poll.
const BYTES_PER_PASS: usize = 512;
/// Bytes handed to the decoders at once.
const CHUNK: usize = 64;
/// Losses on a port are said this often at most.
const SAY_LOSSES_EVERY: Duration = Duration::from_secs(10);

/// A frame on its way out. The next one is asked for only when this one has left, so that a setpoint never waits
/// behind telemetry that is older.
struct Leaving {
    bytes: [u8; MAX_FRAME_BYTES],
    start: usize,
    end: usize,
}

/// What was last said of a port's losses.
struct Watch {
    name: &'static str,
    said: PortStats,
    said_at: Option<Instant>,
}

impl Watch {
    const fn new(name: &'static str) -> Watch {
        Watch { name, said: PortStats { lost: 0, damaged: 0 }, said_at: None }
    }

    /// Whether losses are new and it is time to say so.
    fn is_news(&mut self, now: Instant, stats: PortStats) -> bool {
        let quiet = self.said_at.is_some_and(|at| now.since(at) < SAY_LOSSES_EVERY);
        if stats == self.said || quiet {
            return false;
        }
        self.said = stats;
        self.said_at = Some(now);
        true
    }
}

/// The pilot with its two ports.
pub struct Runtime<'p, P, L, R> {
    onboard: &'p mut Onboard<Timed<P>>,
    link: L,
    radio: R,
    leaving: Leaving,
    next_tick: Instant,
    said: State,
    watches: [Watch; 2],
}

impl<'p, P, L, R> Runtime<'p, P, L, R>
where
    P: Policy,
    L: Read + ReadReady + Write + WriteReady,
    R: Read + ReadReady,
{
    /// Around a pilot at boot: `link` leads to the autopilot, `radio` to the modem that reports.
    pub fn new(onboard: &'p mut Onboard<Timed<P>>, link: L, radio: R) -> Runtime<'p, P, L, R> {
        Runtime {
            onboard,
            link,
            radio,
            leaving: Leaving { bytes: [0; MAX_FRAME_BYTES], start: 0, end: 0 },
            next_tick: Instant::ZERO,
            said: State::Boot,
            watches: [Watch::new("link"), Watch::new("radio")],
        }
    }

    /// One turn of the main loop; whether the pilot was polled: then, and only then, the watchdog may be fed.
    /// `losses` are the counters of the link's and of the radio's port.
    ///
    /// # Cost
    /// At most 512 bytes of each port and one poll, which may hold one inference.
    pub fn pass(&mut self, now: Instant, losses: [PortStats; 2], journal: &mut impl Journal) -> bool {
        self.hear(now);
        let due = now >= self.next_tick;
        if due {
            self.tick(now, losses, journal);
            self.next_tick = (self.next_tick + POLL_INTERVAL).max(now);
        }
        self.speak();
        due
    }

    /// The pilot, to look at and to speak through.
    pub fn onboard(&mut self) -> &mut Onboard<Timed<P>> {
        self.onboard
    }

    fn hear(&mut self, now: Instant) {
        let onboard = &mut *self.onboard;
        take(&mut self.link, |bytes| onboard.receive_link(now, bytes));
        take(&mut self.radio, |bytes| onboard.receive_radio(now, bytes));
    }

    fn tick(&mut self, now: Instant, losses: [PortStats; 2], journal: &mut impl Journal) {
        for (watch, stats) in self.watches.iter_mut().zip(losses) {
            if watch.is_news(now, stats) {
                let PortStats { lost, damaged } = stats;
                let name = watch.name;
                self.onboard.say(
                    Severity::Warning,
                    format_args!("gleaner: {name} port lost {lost}, damaged {damaged}"),
                );
                journal.losses(name, stats);
            }
        }
        self.onboard.poll(now);
        let took = self.onboard.policy().take();
        if let Some(took) = took {
            self.onboard.set_inference_time(took);
        }
        if let Some(decision) = self.onboard.decision() {
            journal.decision(decision, took);
        }
        let state = self.onboard.state();
        if state != self.said {
            journal.state(self.said, state);
            self.said = state;
        }
    }

    fn speak(&mut self) {
        loop {
            let Leaving { bytes, start, end } = &mut self.leaving;
            if start == end {
                *start = 0;
                *end = self.onboard.transmit(bytes);
            }
            let rest = bytes.get(*start..*end).unwrap_or(&[]);
            if rest.is_empty() || !self.link.write_ready().unwrap_or(false) {
                return;
            }
            *start += self.link.write(rest).unwrap_or(rest.len());
        }
    }
}

/// Hands over what a port holds, up to a limit.
fn take(port: &mut (impl Read + ReadReady), mut receive: impl FnMut(&[u8])) {
    let mut buffer = [0; CHUNK];
    for _ in 0..BYTES_PER_PASS / CHUNK {
        if !port.read_ready().unwrap_or(false) {
            return;
        }
        let count = port.read(&mut buffer).unwrap_or(0);
        receive(buffer.get(..count).unwrap_or(&[]));
    }
}

#[cfg(test)]
mod tests;
