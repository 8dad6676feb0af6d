//! Commands of ours to the autopilot, repeated until acknowledged.

use crate::event::Events;
use crate::{Address, CommandAck, CommandResult, Event, Outgoing, Packet, Priority};
use gleaner_units::{Duration, Instant, MetresPerSecond};
use heapless::Vec;
use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd};

/// What we may ask of the autopilot. A mode in which we steer is not among it, on purpose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AutopilotCommand {
    /// `MAV_CMD_NAV_LAND`: land here.
    Land,
    /// `MAV_CMD_NAV_RETURN_TO_LAUNCH`.
    ReturnToLaunch,
    /// `MAV_CMD_DO_CHANGE_SPEED`, ground speed. PX4 accepts it without effect in OFFBOARD.
    ChangeSpeed(MetresPerSecond),
}

/// How a request ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The autopilot accepted.
    Accepted,
    /// The autopilot refused.
    Refused(CommandResult),
    /// No acknowledgement after three transmissions.
    NoAnswer,
    /// A newer request of the same kind took its place.
    Superseded,
}

impl AutopilotCommand {
    /// The commands behind all of them: each moves the aircraft.
    pub(crate) const KINDS: [MavCmd; 3] =
        [MavCmd::MAV_CMD_NAV_LAND, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, MavCmd::MAV_CMD_DO_CHANGE_SPEED];

    fn wire(self) -> (MavCmd, [f32; 3]) {
        match self {
            AutopilotCommand::Land => (MavCmd::MAV_CMD_NAV_LAND, [0.0; 3]),
            AutopilotCommand::ReturnToLaunch => (MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, [0.0; 3]),
            // 1: ground speed; throttle -1: no change.
            AutopilotCommand::ChangeSpeed(speed) => (MavCmd::MAV_CMD_DO_CHANGE_SPEED, [1.0, speed.0, -1.0]),
        }
    }

    pub(crate) fn is_finite(self) -> bool {
        self.wire().1.iter().all(|param| param.is_finite())
    }

    fn is_same_kind(self, other: AutopilotCommand) -> bool {
        self.wire().0 == other.wire().0
    }
}

/// `COMMAND_LONG` to the autopilot.
pub(crate) fn command_packet(
    target: Address,
    command: MavCmd,
    params: [f32; 3],
    confirmation: u8,
) -> Option<Packet> {
    let [param1, param2, param3] = params;
    Packet::new(&COMMAND_LONG_DATA {
        param1,
        param2,
        param3,
        command,
        target_system: target.system,
        target_component: target.component,
        confirmation,
        ..COMMAND_LONG_DATA::DEFAULT
    })
}

#[derive(Debug)]
struct Pending {
    command: AutopilotCommand,
    transmissions: u8,
    next_at: Instant,
    begun_at: Instant,
    sent_at: Option<Instant>,
}

/// The requests under way, at most one of a kind.
#[derive(Debug, Default)]
pub(crate) struct Requests {
    pending: Vec<Pending, 4>,
}

impl Requests {
    const INTERVAL: Duration = Duration::from_secs(1);
    const TRANSMISSIONS: u8 = 3;
    /// A request ends after this time, however few transmissions were possible.
    const LONGEST: Duration = Duration::from_secs(8);
    /// How long an acknowledgement "in progress" keeps us quiet.
    const PROGRESS: Duration = Duration::from_secs(5);

    /// Begins a request; it leaves with the next poll. An older one of its kind ends.
    pub fn begin(&mut self, now: Instant, command: AutopilotCommand, events: &mut Events) {
        self.end(events, Outcome::Superseded, |pending| pending.command.is_same_kind(command));
        // There are fewer kinds than places.
        let _ = self.pending.push(Pending {
            command,
            transmissions: 0,
            next_at: now,
            begun_at: now,
            sent_at: None,
        });
    }

    /// Ends everything: the autopilot is gone or started again.
    pub fn abandon(&mut self, events: &mut Events) {
        self.end(events, Outcome::NoAnswer, |_| true);
    }

    /// The autopilot answered some command.
    pub fn acknowledged(&mut self, now: Instant, ack: &CommandAck, events: &mut Events) {
        let is_it = |pending: &Pending| pending.command.wire().0 as u32 == u32::from(ack.command);
        let outcome = match ack.result {
            CommandResult::InProgress => {
                for pending in self.pending.iter_mut().filter(|pending| is_it(pending)) {
                    pending.next_at = now + Requests::PROGRESS;
                }
                return;
            }
            CommandResult::Accepted => Outcome::Accepted,
            refused => Outcome::Refused(refused),
        };
        self.end(events, outcome, is_it);
    }

    /// Sends what is due. `ours_at`: when a heartbeat last showed that the aircraft is ours. A request is repeated only
    /// after such a heartbeat arrived since its last transmission: in between the aircraft may have changed hands.
    pub fn poll(
        &mut self,
        now: Instant,
        autopilot: Address,
        ours_at: Option<Instant>,
        out: &mut Outgoing,
        events: &mut Events,
    ) {
        self.end(events, Outcome::NoAnswer, |pending| {
            let all_sent = now >= pending.next_at && pending.transmissions >= Requests::TRANSMISSIONS;
            all_sent || now.since(pending.begun_at) >= Requests::LONGEST
        });
        let is_due = |pending: &Pending| {
            let heard_since =
                ours_at.is_some_and(|ours_at| pending.sent_at.is_none_or(|sent_at| ours_at > sent_at));
            now >= pending.next_at && pending.transmissions < Requests::TRANSMISSIONS && heard_since
        };
        for pending in self.pending.iter_mut().filter(|pending| is_due(pending)) {
            let (command, params) = pending.command.wire();
            let Some(packet) = command_packet(autopilot, command, params, pending.transmissions) else {
                continue;
            };
            if out.push(Priority::Urgent, packet) {
                pending.transmissions += 1;
                pending.sent_at = Some(now);
                pending.next_at = now + Requests::INTERVAL;
            }
        }
    }

    fn end(&mut self, events: &mut Events, outcome: Outcome, is_over: impl Fn(&Pending) -> bool) {
        self.pending.retain(|pending| {
            let over = is_over(pending);
            if over {
                events.push(Event::RequestEnded { command: pending.command, outcome });
            }
            !over
        });
    }
}
