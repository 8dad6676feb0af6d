//! The main loop of every board: receive bytes, poll the pilot every 20 ms, transmit bytes.

use crate::{EventLog, PortStats};
use embedded_io::{Read, ReadReady, Write, WriteReady};
use gleaner_link::{MAX_FRAME_BYTES, Severity};
use gleaner_pilot::{ChannelAware, Onboard, POLL_INTERVAL, State};
use gleaner_policy::{Policy, Timed};
use gleaner_units::{Duration, Instant};

/// Most bytes read from one port in one pass: a flood on one port must not delay the poll.
const BYTES_PER_PASS: usize = 512;
/// Bytes passed to a decoder at once.
const CHUNK: usize = 64;
/// Shortest time between two reports of losses on a port.
const LOSS_REPORT_PERIOD: Duration = Duration::from_secs(10);

/// A frame that is being transmitted. The next one is requested only when this one is complete, so that a setpoint
/// never queues behind older telemetry.
struct Transmission {
    bytes: [u8; MAX_FRAME_BYTES],
    start: usize,
    end: usize,
}

/// The last report of a port's losses.
struct LossReport {
    name: &'static str,
    reported: PortStats,
    reported_at: Option<Instant>,
}

impl LossReport {
    const fn new(name: &'static str) -> LossReport {
        LossReport { name, reported: PortStats { lost: 0, damaged: 0 }, reported_at: None }
    }

    /// Whether the counters changed and a report is due; counts as reported then.
    fn is_due(&mut self, now: Instant, stats: PortStats) -> bool {
        let recent = self.reported_at.is_some_and(|at| now.since(at) < LOSS_REPORT_PERIOD);
        if stats == self.reported || recent {
            return false;
        }
        self.reported = stats;
        self.reported_at = Some(now);
        true
    }
}

/// The pilot of a board: it times its network and estimates the channel.
pub type Pilot<P> = Onboard<ChannelAware<Timed<P>>>;

/// The pilot and its two ports.
pub struct Runtime<'p, P, L, R> {
    onboard: &'p mut Pilot<P>,
    link: L,
    radio: R,
    transmission: Transmission,
    next_tick: Instant,
    logged: State,
    reports: [LossReport; 2],
}

impl<'p, P, L, R> Runtime<'p, P, L, R>
where
    P: Policy,
    L: Read + ReadReady + Write + WriteReady,
    R: Read + ReadReady,
{
    /// `link` is connected to the autopilot, `radio` to the modem that sends reports. The pilot has not been polled.
    pub fn new(onboard: &'p mut Pilot<P>, link: L, radio: R) -> Runtime<'p, P, L, R> {
        Runtime {
            onboard,
            link,
            radio,
            transmission: Transmission { bytes: [0; MAX_FRAME_BYTES], start: 0, end: 0 },
            next_tick: Instant::ZERO,
            logged: State::Boot,
            reports: [LossReport::new("link"), LossReport::new("radio")],
        }
    }

    /// One iteration of the main loop. Returns whether the pilot was polled: feed the watchdog then, and only then.
    /// `losses` are the counters of the link port and of the radio port.
    ///
    /// # Cost
    /// At most 512 bytes of each port and one poll, which may include one inference.
    pub fn pass(&mut self, now: Instant, losses: [PortStats; 2], log: &mut impl EventLog) -> bool {
        self.receive(now);
        let due = now >= self.next_tick;
        if due {
            self.tick(now, losses, log);
            self.next_tick = (self.next_tick + POLL_INTERVAL).max(now);
        }
        self.transmit();
        due
    }

    /// The pilot.
    pub fn onboard(&mut self) -> &mut Pilot<P> {
        self.onboard
    }

    fn receive(&mut self, now: Instant) {
        let onboard = &mut *self.onboard;
        drain(&mut self.link, |bytes| onboard.receive_link(now, bytes));
        drain(&mut self.radio, |bytes| onboard.receive_radio(now, bytes));
    }

    fn tick(&mut self, now: Instant, losses: [PortStats; 2], log: &mut impl EventLog) {
        for (report, stats) in self.reports.iter_mut().zip(losses) {
            if report.is_due(now, stats) {
                let PortStats { lost, damaged } = stats;
                let name = report.name;
                self.onboard.say(
                    Severity::Warning,
                    format_args!("gleaner: {name} port lost {lost}, damaged {damaged}"),
                );
                log.losses(name, stats);
            }
        }
        let revocations = self.onboard.revocations();
        self.onboard.poll(now);
        if self.onboard.revocations() != revocations {
            // Nothing that moves the aircraft may leave any more. The rest of a frame that left in part is missing at the
            // receiver, which discards it by its checksum.
            self.transmission.start = self.transmission.end;
        }
        let took = self.onboard.policy().network().take();
        if let Some(took) = took {
            self.onboard.set_inference_time(took);
        }
        if let Some(decision) = self.onboard.decision() {
            log.decision(decision, took);
        }
        let state = self.onboard.state();
        if state != self.logged {
            log.state(self.logged, state);
            self.logged = state;
        }
    }

    fn transmit(&mut self) {
        loop {
            let Transmission { bytes, start, end } = &mut self.transmission;
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

/// Reads what a port holds, at most `BYTES_PER_PASS`, and passes it on in chunks.
fn drain(port: &mut (impl Read + ReadReady), mut receive: impl FnMut(&[u8])) {
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
