//! What others ask of us.

use super::{Component, EnableSet, count};
use crate::commands::{Effect, Requested, judge};
use crate::{
    Address, Change, Command, CommandResult, Enable, Event, Message, OperatorRequest, ParameterError,
    ParameterId, ParameterKey, Severity, TUNNEL_RADIO_REPORT,
};
use gleaner_units::{Duration, Instant};

impl Component {
    /// Acts on a message that is for us.
    pub(super) fn answer(&mut self, now: Instant, sender: Address, message: &Message) {
        match message {
            Message::Command(command) => self.answer_command(now, command),
            Message::ParameterList { .. } => self.parameter_service.tell_all(),
            Message::ParameterRead { target, key } => self.answer_parameter_read(*target, key),
            Message::ParameterSet { target, name, value } => {
                self.answer_parameter_set(now, sender, *target, name, *value);
            }
            Message::TimesyncRequest { asked_ns, .. } => self.send_timesync(now, sender, *asked_ns),
            Message::Tunnel { payload_type: TUNNEL_RADIO_REPORT, payload, .. } => {
                self.events.push(Event::RadioReport(payload.clone()));
            }
            _ => {}
        }
    }

    /// One acknowledgement to the sender of each command. A command to all components that we do not know is
    /// left to those who do: an answer "unsupported" would be taken for the autopilot's.
    fn answer_command(&mut self, now: Instant, command: &Command) {
        if self.outgoing.urgent_room() < 2 || !self.events.has_room() {
            count(&mut self.stats.commands_postponed);
            return;
        }
        if let Some(result) = self.answers.of_resend(now, command) {
            self.send_ack(command, result);
            return;
        }
        let judged = judge(command, &self.owner);
        let is_for_all = command.target.component == 0;
        let result = match judged {
            Ok(_) => CommandResult::Accepted,
            Err(CommandResult::Unsupported) if is_for_all => return,
            Err(refused) => refused,
        };
        self.send_ack(command, result);
        match judged {
            // Its purpose is to be sent again when asked again, so it is not remembered.
            Ok(Effect::Send(requested)) => self.send_requested(now, requested),
            Ok(Effect::Operator(request)) => {
                self.answers.remember(now, *command, result);
                self.obey(request);
            }
            Err(_) => self.answers.remember(now, *command, result),
        }
    }

    /// Whether a set of `GLN_ENABLE` repeats the last one of its sender because the answer was lost. It does not engage
    /// again: meanwhile the pilot may have taken over. Off is no repetition. The first set counts, so that repetitions
    /// do not prolong each other.
    fn is_enable_resent(&mut self, now: Instant, sender: Address, name: &str, value: f32) -> bool {
        const RESENT_WITHIN: Duration = Duration::from_secs(10);
        if ParameterId::from_name(name) != Some(ParameterId::Enable) {
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
        }
    }

    /// The parameters follow what the operator asked by command.
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
        match id {
            Some(id) => self.parameter_service.tell(id),
            None if target.component == 0 => {}
            None => match key {
                ParameterKey::Index(index) => {
                    self.say(Severity::Warning, format_args!("gleaner: no parameter with index {index}"));
                }
                ParameterKey::Name(name) => {
                    self.say(Severity::Warning, format_args!("gleaner: no parameter {name}"));
                }
            },
        }
    }

    /// Always ends in the resulting value being told, except for names that are not ours.
    fn answer_parameter_set(
        &mut self,
        now: Instant,
        sender: Address,
        target: Address,
        name: &str,
        value: f32,
    ) {
        if !self.events.has_room() {
            // Not set and not answered: the sender tries again.
            count(&mut self.stats.commands_postponed);
            return;
        }
        if self.is_enable_resent(now, sender, name, value) {
            self.parameter_service.tell(ParameterId::Enable);
            return;
        }
        match self.parameters.set(name, value) {
            Ok(change) => {
                self.parameter_service.tell(change.id);
                if let Some(event) = event_of(change) {
                    self.events.push(event);
                }
            }
            Err(ParameterError::Unknown) => {
                if target.component != 0 {
                    self.say(Severity::Warning, format_args!("gleaner: no parameter {name}"));
                }
            }
            Err(error) => {
                if let Some(id) = ParameterId::from_name(name) {
                    self.parameter_service.tell(id);
                }
                self.say(Severity::Warning, format_args!("gleaner: {error}"));
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
