//! Commands to us: judged, run once, always answered.

use crate::{Command, CommandResult, Enable, Status};
use gleaner_units::{Duration, Instant};
use heapless::Deque;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::MavCmd;

/// What a person asked of us.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OperatorRequest {
    /// Weight of data in the preference, 0..1.
    SetPreference(f32),
    /// Off, engage or shadow. Asking again for what already is counts as a new request.
    Enable(Enable),
    /// Fly home now.
    ReturnNow,
}

/// Messages that are sent on request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Requested {
    Heartbeat,
    AutopilotVersion,
    ComponentInformationBasic,
}

/// What an accepted command does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Effect {
    Operator(OperatorRequest),
    Send(Requested),
}

/// Judges a command: the answer, and what it does when it is accepted.
///
/// While the owner cannot engage (self-test failed), "engage" is temporarily rejected; while it flies nothing, "return"
/// is denied.
pub(crate) fn judge(command: &Command, owner: &Status) -> Result<Effect, CommandResult> {
    let [first, ..] = command.params;
    let is = |id: MavCmd| id as u32 == u32::from(command.id);
    if is(MavCmd::MAV_CMD_USER_1) {
        if (0.0..=1.0).contains(&first) {
            return Ok(Effect::Operator(OperatorRequest::SetPreference(first)));
        }
        return Err(CommandResult::Denied);
    }
    if is(MavCmd::MAV_CMD_USER_2) {
        return match Enable::from_value(first) {
            None => Err(CommandResult::Denied),
            Some(Enable::Engage) if !owner.may_engage => Err(CommandResult::TemporarilyRejected),
            Some(enable) => Ok(Effect::Operator(OperatorRequest::Enable(enable))),
        };
    }
    if is(MavCmd::MAV_CMD_USER_3) {
        let request = Effect::Operator(OperatorRequest::ReturnNow);
        return if owner.may_return { Ok(request) } else { Err(CommandResult::Denied) };
    }
    if is(MavCmd::MAV_CMD_REQUEST_MESSAGE) {
        return requested(first).map(Effect::Send).ok_or(CommandResult::Denied);
    }
    Err(CommandResult::Unsupported)
}

fn requested(message_id: f32) -> Option<Requested> {
    let known = [
        (dialect::HEARTBEAT_DATA::ID, Requested::Heartbeat),
        (dialect::AUTOPILOT_VERSION_DATA::ID, Requested::AutopilotVersion),
        (dialect::COMPONENT_INFORMATION_BASIC_DATA::ID, Requested::ComponentInformationBasic),
    ];
    known.into_iter().find(|&(id, _)| id as f32 == message_id).map(|(_, requested)| requested)
}

#[derive(Debug)]
struct Answered {
    command: Command,
    result: CommandResult,
    at: Instant,
}

/// The answers given lately, so that a resend is answered again and not run again.
#[derive(Debug, Default)]
pub(crate) struct Answers {
    recent: Deque<Answered, 8>,
}

impl Answers {
    /// A resend that says so (`confirmation` above 0) arrives within this time of the first.
    const CONFIRMED: Duration = Duration::from_secs(10);
    /// The same command with nothing else from its sender in between: ground stations retry after 3 s.
    const REPEATED: Duration = Duration::from_millis(3_500);

    /// The answer already given if `command` is a resend.
    ///
    /// Only the newest command of a sender can be resent: off, engage, off are three requests, even if the last says
    /// that it was sent before. Off and return are never resends: to act twice on them does no harm.
    pub fn of_resend(&self, now: Instant, command: &Command) -> Option<CommandResult> {
        if is_always_run(command) {
            return None;
        }
        let newest = self.recent.iter().rfind(|answered| answered.command.sender == command.sender)?;
        let age = now.since(newest.at);
        let says_so = command.confirmation > 0 && age <= Answers::CONFIRMED;
        let looks_so = age <= Answers::REPEATED;
        (newest.command.repeats(command) && (says_so || looks_so)).then_some(newest.result)
    }

    /// Remembers an answer.
    pub fn remember(&mut self, now: Instant, command: Command, result: CommandResult) {
        if self.recent.is_full() {
            let _ = self.recent.pop_front();
        }
        let _ = self.recent.push_back(Answered { command, result, at: now });
    }
}

/// Off and return take the aircraft out of our hands or home, and act however often they arrive.
fn is_always_run(command: &Command) -> bool {
    let [first, ..] = command.params;
    let is = |id: MavCmd| id as u32 == u32::from(command.id);
    is(MavCmd::MAV_CMD_USER_3)
        || (is(MavCmd::MAV_CMD_USER_2) && Enable::from_value(first) == Some(Enable::Off))
}
