//! Our commands to the autopilot, repeated until they are acknowledged.

use crate::address::Address;
use crate::autopilot_command::AutopilotCommand;
use crate::event::{Event, Events, Outcome};
use crate::message::{CommandAck, CommandResult};
use crate::wire::outgoing::{Outgoing, Priority};
use crate::wire::packet::Packet;
use gleaner_units::{Duration, Instant};
use heapless::Vec;
use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd};

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

    /// Ends all requests: the autopilot is lost or restarted.
    pub fn abandon(&mut self, events: &mut Events) {
        self.end(events, Outcome::NoAnswer, |_| true);
    }

    /// The autopilot answered a command.
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
