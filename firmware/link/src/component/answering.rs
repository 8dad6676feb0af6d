//! Answers to requests of others.

use super::{Component, EnableSet, count};
use crate::TUNNEL_RADIO_REPORT;
use crate::address::Address;
use crate::event::{Event, OperatorRequest};
use crate::message::{Command, CommandResult, Message, ParameterKey, ParameterName, Severity};
use crate::parameters::{Change, Enable, ParameterError, ParameterId, decode};
use crate::service::commands::{Effect, Refusal, Requested, Title, judge, needs_authority};
use core::fmt;
use gleaner_units::{Decimal, Duration, Instant};

/// The names under which a ground station reads the checksum of a parameter cache (PX4).
const CACHE_CHECKSUM: &str = "_HASH_CHECK";

/// A `PARAM_SET`.
struct Set<'a> {
    sender: Address,
    target: Address,
    name: &'a ParameterName,
    sent: f32,
    kind: u8,
}

impl Component {
    /// Acts on a message that is for us.
    pub(super) fn answer(&mut self, now: Instant, sender: Address, message: &Message) {
        match message {
            Message::Command(command) => self.answer_command(now, command),
            Message::ParameterList { .. } => self.parameter_service.send_all(),
            Message::ParameterRead { target, key } => self.answer_parameter_read(*target, key),
            Message::ParameterSet { target, name, value, kind } => {
                let set = Set { sender, target: *target, name, sent: *value, kind: *kind };
                self.answer_parameter_set(now, &set);
            }
            Message::TimesyncRequest { asked_ns, .. } => self.send_timesync(now, sender, *asked_ns),
            Message::Tunnel { payload_type: TUNNEL_RADIO_REPORT, payload, .. } => {
                self.take_report(sender, payload);
            }
            Message::FileRequest { target, sequence, session, opcode } if *target == self.address() => {
                self.refuse_file_request(sender, *sequence, *session, *opcode);
            }
            _ => {}
        }
    }

    /// A radio report counts only from our vehicle or from an operator.
    fn take_report(&mut self, sender: Address, payload: &[u8]) {
        if sender.system != self.address().system && !self.operators.allow(sender) {
            count(&mut self.stats.foreign_reports);
            return;
        }
        match payload.try_into() {
            Ok(report) => self.events.push(Event::RadioReport(report)),
            Err(_) => count(&mut self.stats.malformed),
        }
    }

    /// One acknowledgement to the sender of each command that names our system and component. A broadcast needs no
    /// answer, except a request for a message that we have: "unsupported" would be taken for the autopilot's answer.
    fn answer_command(&mut self, now: Instant, command: &Command) {
        let is_exact = command.target == self.address();
        if !is_exact && needs_authority(command) {
            count(&mut self.stats.not_addressed);
            return;
        }
        if self.outgoing.urgent_room() < 2 || !self.events.has_room() {
            count(&mut self.stats.commands_postponed);
            return;
        }
        if let Some(result) = self.answers.of_resend(now, command) {
            self.send_ack(command, result);
            return;
        }
        match self.judge(command) {
            Err(Refusal::Unsupported(_)) if !is_exact => {}
            // Not remembered: the operator's next command is a new one, however soon it comes.
            Err(Refusal::Resent) => {
                self.send_ack(command, Refusal::Resent.result());
                self.report_refusal(now, command, Refusal::Resent);
            }
            Err(refusal) => {
                self.send_ack(command, refusal.result());
                self.answers.remember(now, *command, refusal.result());
                self.report_refusal(now, command, refusal);
            }
            // Its purpose is to be sent again when asked again, so it is not remembered.
            Ok(Effect::Send(requested)) => {
                self.send_ack(command, CommandResult::Accepted);
                self.send_requested(now, requested);
            }
            Ok(Effect::Operator(request)) => {
                self.send_ack(command, CommandResult::Accepted);
                self.answers.remember(now, *command, CommandResult::Accepted);
                let (title, sender) = (Title(command), command.sender);
                self.say(Severity::Info, format_args!("gleaner: {title} by {sender}"));
                self.obey(request);
            }
        }
    }

    fn judge(&mut self, command: &Command) -> Result<Effect, Refusal> {
        if needs_authority(command) && !self.operators.allow(command.sender) {
            count(&mut self.stats.not_allowed);
            return Err(Refusal::NotAllowed);
        }
        if self.answers.is_stale_engage(command) {
            return Err(Refusal::Resent);
        }
        let effect = judge(command, &self.owner, self.block)?;
        if effect == Effect::Send(Requested::ComponentMetadata) && self.metadata.is_none() {
            return Err(Refusal::Unsupported(CommandResult::Denied));
        }
        Ok(effect)
    }

    /// Ground stations try commands of all kinds on every component; only operators' commands are worth a text.
    fn report_refusal(&mut self, now: Instant, command: &Command, refusal: Refusal) {
        if needs_authority(command) {
            let (title, sender) = (Title(command), command.sender);
            self.warn(now, sender, format_args!("gleaner: {title} by {sender} refused: {refusal}"));
        }
    }

    /// Says what `sender` is refused. Of those who are no operators, not each.
    fn warn(&mut self, now: Instant, sender: Address, text: fmt::Arguments<'_>) {
        if self.operators.allow(sender) {
            self.say(Severity::Warning, text);
            return;
        }
        match self.strangers.admit(now) {
            None => {}
            Some(0) => self.say(Severity::Warning, text),
            Some(unsaid) => self.say(Severity::Warning, format_args!("{text} ({unsaid} more)")),
        }
    }

    /// Whether a set of `GLN_ENABLE` repeats the last one of its sender because the answer was lost. It does not engage
    /// again: meanwhile the pilot may have taken over. Off is no repetition. The first set counts, so that repetitions
    /// do not prolong each other.
    fn is_enable_resent(&mut self, now: Instant, sender: Address, id: ParameterId, value: f32) -> bool {
        const RESENT_WITHIN: Duration = Duration::from_secs(10);
        if id != ParameterId::Enable {
            return false;
        }
        let is_resent = value != Enable::Off.value()
            && self.enable_set.is_some_and(|set| {
                set.sender == sender && set.value == value && now.since(set.at) <= RESENT_WITHIN
            });
        if !is_resent {
            self.enable_set = Some(EnableSet { sender, value, at: now });
        }
        is_resent
    }

    fn send_requested(&mut self, now: Instant, requested: Requested) {
        match requested {
            // It leaves with the next poll, as every heartbeat does.
            Requested::Heartbeat => self.heartbeat_at = None,
            Requested::AutopilotVersion => self.send_autopilot_version(),
            Requested::ComponentInformationBasic => self.send_component_information(now),
            Requested::ComponentMetadata => self.send_component_metadata(now),
        }
    }

    /// The parameters follow an operator's commands.
    fn obey(&mut self, request: OperatorRequest) {
        let mirrored = match request {
            OperatorRequest::SetPreference(weight) => Some((ParameterId::DataWeight, weight)),
            OperatorRequest::Enable(enable) => Some((ParameterId::Enable, enable.value())),
            OperatorRequest::ReturnNow => None,
        };
        if let Some((id, value)) = mirrored
            && self.set_parameter(id, value).is_err()
        {
            return;
        }
        self.events.push(Event::Operator(request));
    }

    fn answer_parameter_read(&mut self, target: Address, key: &ParameterKey) {
        let id = match key {
            ParameterKey::Index(index) => ParameterId::from_index(*index),
            ParameterKey::Name(name) => ParameterId::from_name(name),
        };
        match (id, key) {
            (Some(id), _) => self.parameter_service.send(id),
            _ if target != self.address() => {}
            (None, ParameterKey::Index(index)) => {
                self.say(Severity::Warning, format_args!("gleaner: no parameter with index {index}"));
            }
            (None, ParameterKey::Name(name)) if name == CACHE_CHECKSUM => {}
            (None, ParameterKey::Name(name)) => {
                self.say(Severity::Warning, format_args!("gleaner: no parameter {name}"));
            }
        }
    }

    /// Sends the resulting value, whether the set was accepted or not. Names that are not ours get no value.
    fn answer_parameter_set(&mut self, now: Instant, set: &Set) {
        let is_exact = set.target == self.address();
        let Some(id) = ParameterId::from_name(set.name) else {
            if is_exact {
                self.warn(now, set.sender, format_args!("gleaner: no parameter {}", set.name));
            }
            return;
        };
        if !is_exact && id == ParameterId::Enable {
            count(&mut self.stats.not_addressed);
            return;
        }
        if !self.events.has_room() {
            // Not set and not answered: the sender tries again.
            count(&mut self.stats.commands_postponed);
            return;
        }
        let (name, sender) = (set.name, set.sender);
        self.parameter_service.send(id);
        if !self.operators.allow(sender) {
            count(&mut self.stats.not_allowed);
            if is_exact {
                let reason = Refusal::NotAllowed;
                self.warn(now, sender, format_args!("gleaner: {name} by {sender} refused: {reason}"));
            }
            return;
        }
        match decode(set.kind, set.sent) {
            Ok(value) => self.set_for(now, sender, id, value),
            Err(error) => {
                self.say(Severity::Warning, format_args!("gleaner: {name} by {sender} refused: {error}"));
            }
        }
    }

    /// Sets a parameter for an operator.
    fn set_for(&mut self, now: Instant, sender: Address, id: ParameterId, value: f32) {
        let name = id.spec().name;
        let is_engage = id == ParameterId::Enable && value == Enable::Engage.value();
        if let Some(block) = self.block.filter(|_| is_engage) {
            self.say(Severity::Warning, format_args!("gleaner: {name} by {sender} refused: {block}"));
            return;
        }
        if self.is_enable_resent(now, sender, id, value) {
            return;
        }
        match self.parameters.set_id(id, value) {
            Ok(change) => {
                if change.old != change.new {
                    let value = Decimal::<2>(change.new);
                    self.say(Severity::Info, format_args!("gleaner: {name} {value:#} by {sender}"));
                }
                if let Some(event) = event_of(change) {
                    self.events.push(event);
                }
            }
            Err(ParameterError::Unknown) => {}
            Err(error) => {
                self.say(Severity::Warning, format_args!("gleaner: {error}, refused to {sender}"));
            }
        }
    }
}

/// A parameter that means the same as a command makes the same event. `GLN_ENABLE` engages only on a change: a file
/// that is loaded with the value in force asks for nothing. Off always acts.
fn event_of(change: Change) -> Option<Event> {
    let event = match change.id {
        ParameterId::DataWeight => Event::Operator(OperatorRequest::SetPreference(change.new)),
        ParameterId::Enable => {
            let enable = Enable::from_value(change.new).unwrap_or(Enable::Off);
            if enable != Enable::Off && change.old == change.new {
                return None;
            }
            Event::Operator(OperatorRequest::Enable(enable))
        }
        _ => Event::Parameter(change),
    };
    Some(event)
}
