//! The decision loop.
//!
//! Bytes are read as they arrive. Every 20 ms the pilot is polled and its messages are sent. Setpoints and heartbeat
//! leave only after a poll: when this loop stops, both stop, and the autopilot's own failsafes act.

use super::console::Console;
use super::files::Files;
use super::page::Page;
use super::service::Service;
use super::{Kept, Logs, unix_time_s};
use crate::clock;
use crate::logs::LogNews;
use crate::models::{FlightPolicy, Models};
use crate::radio::{Radio, describe};
use crate::routing::Links;
use gleaner_link::{MAX_FRAME_BYTES, Severity};
use gleaner_pilot::{Onboard, POLL_INTERVAL};
use gleaner_ports::{Port, RECEIVE_BYTES, State as PortState, wait};
use std::time::{Duration, Instant};

/// Time between polls of the pilot.
const TICK: Duration = Duration::from_micros(POLL_INTERVAL.as_micros());
/// Reads per port and turn: a flood on one port must not delay the poll.
const READS_PER_TURN: usize = 32;
/// After a longer pause messages wait in the system's queues. All of them are read before the pilot is polled, so that it
/// does not act on the oldest as if it were new.
const LATE: Duration = Duration::from_millis(300);
/// Turns of reading after a pause: 8,192 datagrams a port, more than the system keeps.
const DRAIN_TURNS: usize = 256;
/// Time to give the aircraft back when the program is asked to end.
const HAND_BACK: Duration = Duration::from_secs(3);
/// Time for the last messages: status texts leave at ten a second.
const LAST_TEXTS: Duration = Duration::from_millis(300);
/// Time between two reports of the traffic.
const TRAFFIC_PERIOD: Duration = Duration::from_secs(10);

/// The pilot with everything around it.
pub struct Flight {
    onboard: Onboard<FlightPolicy>,
    models: Models,
    files: Files,
    links: Links,
    radio: Option<Radio>,
    logs: Logs,
    kept: Option<Kept>,
    console: Console,
    page: Page,
    service: Service,
    polled_at: Instant,
    traffic_at: Instant,
    revocations: u32,
}

impl Flight {
    /// A pilot that has not been polled yet.
    pub fn new(
        (mut onboard, models): (Onboard<FlightPolicy>, Models),
        links: Links,
        radio: Option<Radio>,
        logs: Logs,
        kept: Option<Kept>,
        (console, page): (Console, Page),
        service: Service,
    ) -> Flight {
        let now = Instant::now();
        let files = Files::new();
        let (uri, crc) = files.general();
        // The URI is short enough.
        let _ = onboard.set_metadata(&uri, crc);
        onboard.offer_models();
        let mut flight = Flight {
            revocations: onboard.revocations(),
            onboard,
            models,
            files,
            links,
            radio,
            logs,
            kept,
            console,
            page,
            service,
            polled_at: now,
            traffic_at: now,
        };
        flight.report_last_run();
        flight.service.ready();
        flight
    }

    /// Reports a last run that did not end as asked.
    fn report_last_run(&mut self) {
        let Some(last) = self.kept.as_mut().and_then(|kept| kept.last_run.take()) else { return };
        self.onboard.resume_budget(last.spent());
        if last.ended() {
            return;
        }
        if let Some(panic) = last.panic() {
            tracing::error!("the last run ended with {panic}");
        }
        self.onboard.say(last.severity(), format_args!("gleaner: {last}"));
    }

    /// Flies until `is_over`.
    pub fn fly(&mut self, is_over: impl Fn() -> bool) {
        let mut next_tick = Instant::now();
        while !is_over() {
            self.receive();
            let now = Instant::now();
            if now >= next_tick {
                self.tick(now);
                next_tick = (next_tick + TICK).max(now);
            }
            self.send();
            self.rest(next_tick.saturating_duration_since(Instant::now()));
        }
    }

    fn receive(&mut self) {
        let late = self.polled_at.elapsed() > LATE;
        for _ in 0..if late { DRAIN_TURNS } else { 1 } {
            if !self.receive_turn() {
                break;
            }
        }
    }

    /// Reads each port; whether bytes may be left.
    fn receive_turn(&mut self) -> bool {
        let Flight { onboard, files, links, logs, console, radio, .. } = self;
        let mut more = links.receive(Instant::now(), READS_PER_TURN, |_, packet| {
            if !files.take(packet, onboard.link().address()) {
                onboard.receive_link(clock::now(), &packet.bytes);
            }
            console.received(packet, onboard.link());
            if let Some(log) = &mut logs.telemetry {
                log.write(&packet.bytes);
            }
        });
        let Some(radio) = radio else { return more };
        let mut buffer = [0; RECEIVE_BYTES];
        for read in 1..=READS_PER_TURN {
            let now = clock::now();
            let bytes = radio.receive(&mut buffer, |report| onboard.receive_report(now, &report));
            if bytes.is_empty() {
                break;
            }
            onboard.observe_radio(bytes);
            more |= read == READS_PER_TURN;
        }
        more
    }

    fn tick(&mut self, now: Instant) {
        self.maintain(now);
        self.report_logs();
        self.take_page_commands(now);
        for reply in self.files.replies() {
            self.onboard.reply_file(reply.to, reply.header, &reply.data);
        }
        self.onboard.poll(clock::at(now));
        self.models.poll(&mut self.onboard);
        self.polled_at = now;
        self.service.feed(now);
        self.revoke();
        let took = self.onboard.policy().take_time();
        if let Some(took) = took {
            self.onboard.set_inference_time(took);
        }
        let position = self.onboard.link().autopilot().position(clock::at(now), MAX_POSITION_AGE);
        let lookahead = self.onboard.logged_lookahead(clock::at(now));
        if let Some(decision) = self.onboard.decision().cloned() {
            self.console.decision(&decision);
            if let Some(log) = &mut self.logs.decisions {
                log.write(&decision, took, position.map(|report| report.position), lookahead);
            }
            self.page.decided(clock::at(now), &decision, &self.onboard);
        }
        if self.console.state(self.onboard.state()) {
            self.service.status(self.onboard.state().name());
        }
        self.keep(now);
    }

    /// The page commands as a ground station does, and its frames stand in the log like those of one.
    fn take_page_commands(&mut self, now: Instant) {
        for frame in self.page.poll(now, &self.onboard) {
            self.onboard.receive_link(clock::at(now), &frame);
            if let Some(log) = &mut self.logs.telemetry {
                log.write(&frame);
            }
        }
    }

    /// After a take-over nothing of ours that moves the aircraft may leave, not even from the queues of the ports.
    fn revoke(&mut self) {
        let revocations = self.onboard.revocations();
        if std::mem::replace(&mut self.revocations, revocations) != revocations {
            let dropped = self.links.revoke();
            tracing::debug!("revoked: {dropped} queued frames dropped");
        }
    }

    fn keep(&mut self, now: Instant) {
        let Some(kept) = &mut self.kept else { return };
        let (state, spent) = (self.onboard.state(), self.onboard.machine().spent());
        let faults = [
            kept.parameters.poll(now, self.onboard.parameters()),
            kept.this_run.note(state, spent, unix_time_s()),
        ];
        for fault in faults.into_iter().flatten() {
            tracing::warn!("state folder: {fault}: parameters set from the ground may be lost");
            self.onboard.say(Severity::Warning, format_args!("gleaner: cannot save parameters"));
        }
    }

    /// Reports once what went down or came back. A lost port opens again by itself.
    fn maintain(&mut self, now: Instant) {
        let Flight { onboard, links, radio, .. } = self;
        let mut report = |role: &'static str, port: &Port, state: PortState| match state {
            PortState::Up => {
                tracing::info!("{role} port {} is back", port.endpoint());
                onboard.say(Severity::Notice, format_args!("gleaner: {role} port is back"));
            }
            // A text about the autopilot's own port reaches the operator when the port is back.
            PortState::Down(reason) => {
                tracing::warn!("{role} port {} is down: {reason}: trying to open it again", port.endpoint());
                onboard.say(Severity::Warning, format_args!("gleaner: {role} port down, retrying"));
            }
        };
        links.maintain(now, &mut report);
        if let Some(radio) = radio
            && let Some(state) = radio.maintain(now)
        {
            report("radio", radio.port(), state);
        }
        if now.saturating_duration_since(self.traffic_at) >= TRAFFIC_PERIOD {
            self.traffic_at = now;
            for line in self.links.summary().chain(self.radio.as_ref().map(summary)) {
                tracing::debug!("{line}");
            }
            if let Some(faults) = self.radio.as_mut().and_then(Radio::new_faults) {
                tracing::warn!("radio: {faults}");
            }
        }
    }

    /// The flight continues without a log; the operator gets a text.
    fn report_logs(&mut self) {
        while let Ok(news) = self.logs.news.try_recv() {
            match news {
                LogNews::Failing(name, cause) => {
                    tracing::error!("{name}: {cause}: make room on the disk; flying on without the log");
                    self.onboard.say(Severity::Warning, format_args!("gleaner: {name}: disk full"));
                }
                LogNews::Slow(name) => {
                    tracing::error!("{name}: the disk is too slow; records are lost, flying on");
                    self.onboard.say(Severity::Warning, format_args!("gleaner: {name}: disk too slow"));
                }
                LogNews::Writing(name, lost) => {
                    tracing::warn!("{name}: writing again after {lost} lost records");
                    self.onboard.say(Severity::Notice, format_args!("gleaner: {name}: writing again"));
                }
            }
        }
    }

    fn send(&mut self) {
        let Flight { onboard, links, logs, console, page, .. } = self;
        let now = Instant::now();
        let mut frame = [0; MAX_FRAME_BYTES];
        loop {
            let bytes = onboard.transmit(&mut frame);
            if bytes == 0 {
                return;
            }
            page.sent(&frame[..bytes]);
            links.send(now, &frame[..bytes], |packet| {
                console.sent(packet);
                if let Some(log) = &mut logs.telemetry {
                    log.write(&packet.bytes);
                }
            });
        }
    }

    fn rest(&self, at_most: Duration) {
        let ports: Vec<&Port> =
            self.links.ports().map(|(_, port)| port).chain(self.radio.as_ref().map(Radio::port)).collect();
        if wait(&ports, at_most).is_err() {
            // Without the system's help the ports are read once a tick.
            std::thread::sleep(at_most);
        }
    }

    /// Gives the aircraft back and sends the last texts. Nothing is sent after that: heartbeat and targets have ended.
    pub fn end(mut self) {
        self.service.stopping();
        if self.onboard.state().flies() {
            self.onboard.say(Severity::Critical, format_args!("gleaner: stopped in flight, take over now"));
            tracing::warn!("stopped in flight: giving the aircraft back to the autopilot");
            self.onboard.hand_back();
            let deadline = Instant::now() + HAND_BACK;
            while self.onboard.is_handing_back() && Instant::now() < deadline {
                let tick = Instant::now() + TICK;
                self.fly(|| Instant::now() >= tick);
            }
            if self.onboard.is_handing_back() {
                tracing::error!("the autopilot has not accepted the request: take over now");
            }
        } else {
            self.onboard.say(Severity::Warning, format_args!("gleaner: stopped"));
        }
        let end = Instant::now() + LAST_TEXTS;
        self.fly(|| Instant::now() >= end);
        let decisions = self.onboard.stats().decisions;
        tracing::info!("stopped after {decisions} decisions: setpoints and heartbeat have ended");
        for line in self.links.summary().chain(self.radio.as_ref().map(summary)) {
            tracing::info!("{line}");
        }
        if self.links.loops() > 0 {
            tracing::warn!(
                "{} packets went around a loop: two ports reach the same network",
                self.links.loops()
            );
        }
        if let Some(kept) = self.kept {
            kept.parameters.close();
            let spent = self.onboard.machine().spent();
            kept.this_run.close(self.onboard.state(), spent, unix_time_s());
        }
        self.links.close();
        self.logs.close();
    }
}

/// An older position is not logged.
const MAX_POSITION_AGE: gleaner_units::Duration = gleaner_units::Duration::from_millis(2_000);

/// One line of counters for the radio's port.
fn summary(radio: &Radio) -> String {
    format!("radio port {}: {}", radio.port().endpoint(), describe(&radio.stats()))
}
