//! Requests for the messages that we need from the autopilot, until they arrive.
//!
//! ArduPilot sends only heartbeats unless asked; PX4 sends most messages unasked, some of them too rarely. The answer
//! to `MAV_CMD_SET_MESSAGE_INTERVAL` does not name the message, so one request is open at a time.

use crate::address::Address;
use crate::message::{CommandResult, Message};
use crate::mode::Firmware;
use crate::service::requests::command_packet;
use crate::wire::outgoing::{Outgoing, Priority};
use gleaner_units::{Duration, Instant};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::MavCmd;

struct Stream {
    message_id: u32,
    period: Duration,
    /// The firmware that has it; `None` for both.
    only: Option<Firmware>,
}

const fn stream(message_id: u32, rate_hz: u64, only: Option<Firmware>) -> Stream {
    Stream { message_id, period: Duration::from_micros(1_000_000 / rate_hz), only }
}

const COUNT: usize = 10;

/// The most needed first.
const STREAMS: [Stream; COUNT] = [
    stream(dialect::LOCAL_POSITION_NED_DATA::ID, 10, None),
    stream(dialect::EXTENDED_SYS_STATE_DATA::ID, 2, None),
    stream(dialect::EKF_STATUS_REPORT_DATA::ID, 2, Some(Firmware::ArduPilot)),
    stream(dialect::ESTIMATOR_STATUS_DATA::ID, 2, Some(Firmware::Px4)),
    stream(dialect::BATTERY_STATUS_DATA::ID, 2, None),
    stream(dialect::SYS_STATUS_DATA::ID, 2, None),
    stream(dialect::HOME_POSITION_DATA::ID, 1, None),
    stream(dialect::GLOBAL_POSITION_INT_DATA::ID, 2, None),
    // A target of ours leaves after each report: the stream of moving targets needs more than 10 Hz.
    stream(dialect::POSITION_TARGET_LOCAL_NED_DATA::ID, 12, None),
    stream(dialect::RC_CHANNELS_DATA::ID, 5, None),
];

/// Row of a message in [`STREAMS`].
fn row_of(message: &Message) -> Option<usize> {
    let id = match message {
        Message::LocalPosition(_) => dialect::LOCAL_POSITION_NED_DATA::ID,
        Message::LandedState(_) => dialect::EXTENDED_SYS_STATE_DATA::ID,
        Message::EkfStatus(_) => dialect::EKF_STATUS_REPORT_DATA::ID,
        Message::EstimatorStatus(_) => dialect::ESTIMATOR_STATUS_DATA::ID,
        Message::BatteryStatus(_) => dialect::BATTERY_STATUS_DATA::ID,
        Message::SysStatus(_) => dialect::SYS_STATUS_DATA::ID,
        Message::HomePosition(_) => dialect::HOME_POSITION_DATA::ID,
        Message::GlobalPosition(_) => dialect::GLOBAL_POSITION_INT_DATA::ID,
        Message::FollowedTarget(_) => dialect::POSITION_TARGET_LOCAL_NED_DATA::ID,
        Message::RcChannels(_) => dialect::RC_CHANNELS_DATA::ID,
        _ => return None,
    };
    STREAMS.iter().position(|stream| stream.message_id == id)
}

#[derive(Clone, Copy, Debug, Default)]
struct Progress {
    /// The request was answered, with any result.
    answered: bool,
    seen_at: Option<Instant>,
    ask_at: Instant,
}

/// What is wanted beyond the streams that are always needed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wants {
    /// The estimator's origin is unknown.
    pub origin: bool,
    /// RC channels: one is mapped to a parameter.
    pub rc: bool,
}

/// Progress of the requests. A fresh one asks for every stream.
#[derive(Debug, Default)]
pub(crate) struct Streams {
    progress: [Progress; COUNT],
    /// The row of the open request, and when it was sent.
    asking: Option<(usize, Instant)>,
    origin_ask_at: Instant,
}

impl Streams {
    /// A known origin is requested again: it can move in flight, PX4 does not send it unasked, and a message of ArduPilot
    /// may be lost.
    const ORIGIN_PERIOD: Duration = Duration::from_secs(2);
    /// Time to wait for the answer to a request.
    const ANSWER: Duration = Duration::from_secs(1);
    /// After an accepted request: time until the message must have arrived.
    const ACCEPTED: Duration = Duration::from_secs(5);
    /// After a refused request: time until the next one.
    const REFUSED: Duration = Duration::from_secs(30);
    /// A stream has stopped when three periods, and at least this long, pass without a message.
    const DEAD: Duration = Duration::from_secs(3);

    /// A message of the autopilot arrived.
    pub fn seen(&mut self, now: Instant, message: &Message) {
        if let Some(progress) = row_of(message).and_then(|row| self.progress.get_mut(row)) {
            progress.seen_at = Some(now);
        }
    }

    /// The autopilot answered a `MAV_CMD_SET_MESSAGE_INTERVAL`.
    pub fn answered(&mut self, now: Instant, result: CommandResult) {
        let Some((row, _)) = self.asking.take() else { return };
        if let Some(progress) = self.progress.get_mut(row) {
            let accepted = result == CommandResult::Accepted;
            progress.answered = true;
            progress.ask_at = now + if accepted { Streams::ACCEPTED } else { Streams::REFUSED };
        }
    }

    /// Asks for the next missing stream, and for what else is wanted.
    pub fn poll(
        &mut self,
        now: Instant,
        target: Address,
        firmware: Firmware,
        wants: Wants,
        out: &mut Outgoing,
    ) {
        if now >= self.origin_ask_at {
            let id = dialect::GPS_GLOBAL_ORIGIN_DATA::ID as f32;
            send(target, MavCmd::MAV_CMD_REQUEST_MESSAGE, [id, 0.0, 0.0], out);
            self.origin_ask_at = now + if wants.origin { Streams::ACCEPTED } else { Streams::ORIGIN_PERIOD };
        }
        if self.asking.is_some_and(|(_, since)| now.since(since) < Streams::ANSWER) {
            return;
        }
        let missing = |&(row, stream): &(usize, &Stream)| {
            stream.only.is_none_or(|only| only == firmware || matches!(firmware, Firmware::Other(_)))
                && (wants.rc || stream.message_id != dialect::RC_CHANNELS_DATA::ID)
                && self.progress.get(row).is_some_and(|progress| progress.needs_asking(now, stream))
        };
        // The one that has waited longest; among equals, the first in the table.
        let waiting_since =
            |&(row, _): &(usize, &Stream)| self.progress.get(row).map(|progress| progress.ask_at);
        let next = STREAMS.iter().enumerate().filter(missing).min_by_key(waiting_since);
        self.asking = next.map(|(row, stream)| {
            let interval_us = stream.period.as_micros() as f32;
            send(
                target,
                MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
                [stream.message_id as f32, interval_us, 0.0],
                out,
            );
            (row, now)
        });
        if let Some(progress) = self.asking.and_then(|(row, _)| self.progress.get_mut(row)) {
            progress.ask_at = now + Streams::ANSWER;
        }
    }
}

impl Progress {
    fn needs_asking(&self, now: Instant, stream: &Stream) -> bool {
        let dead = Duration::from_micros(3 * stream.period.as_micros()).max(Streams::DEAD);
        let alive = self.seen_at.is_some_and(|at| now.since(at) < dead);
        now >= self.ask_at && !(self.answered && alive)
    }
}

fn send(target: Address, command: MavCmd, params: [f32; 3], out: &mut Outgoing) {
    if let Some(packet) = command_packet(target, command, params, 0) {
        out.push(Priority::Urgent, packet);
    }
}
