//! Commands to us: judged, run once, always answered.

use crate::event::OperatorRequest;
use crate::message::{Command, CommandResult};
use crate::parameters::Enable;
use crate::settings::{EngageBlock, Status};
use core::fmt;
use gleaner_units::{Decimal, Duration, Instant};
use heapless::Deque;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::MavCmd;

/// Messages that are sent on request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Requested {
    Heartbeat,
    AutopilotVersion,
    ComponentInformationBasic,
    ComponentMetadata,
}

/// Effect of an accepted command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Effect {
    Operator(OperatorRequest),
    Send(Requested),
}

/// Why an operator's command is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The sender is not on the allow-list.
    NotAllowed,
    /// A parameter outside its range.
    Value,
    /// The owner cannot engage.
    NotReady,
    /// Nothing is flown.
    NotFlying,
    /// The repetition of a request to engage that has already been run, long after it.
    Resent,
    /// The link cannot serve the vehicle safely.
    Blocked(EngageBlock),
    /// No such command, or no such message to send.
    Unsupported(CommandResult),
}

impl Refusal {
    pub const fn result(self) -> CommandResult {
        match self {
            Refusal::NotAllowed | Refusal::Value | Refusal::NotFlying => CommandResult::Denied,
            Refusal::NotReady | Refusal::Resent | Refusal::Blocked(_) => CommandResult::TemporarilyRejected,
            Refusal::Unsupported(result) => result,
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refusal::NotAllowed => f.write_str("not an operator"),
            Refusal::Value => f.write_str("bad value"),
            Refusal::NotReady => f.write_str("not ready"),
            Refusal::NotFlying => f.write_str("not flying"),
            Refusal::Resent => f.write_str("old request, send a new one"),
            Refusal::Blocked(block) => write!(f, "{block}"),
            Refusal::Unsupported(_) => f.write_str("unsupported"),
        }
    }
}

fn is(command: &Command, id: MavCmd) -> bool {
    id as u32 == u32::from(command.id)
}

/// Whether a command needs authority: it engages, moves the aircraft or changes how it flies.
pub(crate) fn needs_authority(command: &Command) -> bool {
    [MavCmd::MAV_CMD_USER_1, MavCmd::MAV_CMD_USER_2, MavCmd::MAV_CMD_USER_3]
        .into_iter()
        .any(|id| is(command, id))
}

/// Judges a command: its effect, or why it is refused.
pub(crate) fn judge(
    command: &Command,
    owner: &Status,
    block: Option<EngageBlock>,
) -> Result<Effect, Refusal> {
    let [first, ..] = command.params;
    if is(command, MavCmd::MAV_CMD_USER_1) {
        if (0.0..=1.0).contains(&first) {
            return Ok(Effect::Operator(OperatorRequest::SetPreference(first)));
        }
        return Err(Refusal::Value);
    }
    if is(command, MavCmd::MAV_CMD_USER_2) {
        return match (Enable::from_value(first), block) {
            (None, _) => Err(Refusal::Value),
            (Some(Enable::Engage), Some(block)) => Err(Refusal::Blocked(block)),
            (Some(Enable::Engage), None) if !owner.may_engage => Err(Refusal::NotReady),
            (Some(enable), _) => Ok(Effect::Operator(OperatorRequest::Enable(enable))),
        };
    }
    if is(command, MavCmd::MAV_CMD_USER_3) {
        let request = Effect::Operator(OperatorRequest::ReturnNow);
        return if owner.may_return { Ok(request) } else { Err(Refusal::NotFlying) };
    }
    if is(command, MavCmd::MAV_CMD_REQUEST_MESSAGE) {
        return requested(first).map(Effect::Send).ok_or(Refusal::Unsupported(CommandResult::Denied));
    }
    Err(Refusal::Unsupported(CommandResult::Unsupported))
}

fn requested(message_id: f32) -> Option<Requested> {
    let known = [
        (dialect::HEARTBEAT_DATA::ID, Requested::Heartbeat),
        (dialect::AUTOPILOT_VERSION_DATA::ID, Requested::AutopilotVersion),
        (dialect::COMPONENT_INFORMATION_BASIC_DATA::ID, Requested::ComponentInformationBasic),
        (dialect::COMPONENT_METADATA_DATA::ID, Requested::ComponentMetadata),
    ];
    known.into_iter().find(|&(id, _)| id as f32 == message_id).map(|(_, requested)| requested)
}

/// Name of an operator's command in a status text.
pub(crate) struct Title<'a>(pub &'a Command);

impl fmt::Display for Title<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, ..] = self.0.params;
        if is(self.0, MavCmd::MAV_CMD_USER_3) {
            return f.write_str("return");
        }
        if is(self.0, MavCmd::MAV_CMD_USER_1) {
            return write_preference(f, first);
        }
        f.write_str(match Enable::from_value(first) {
            Some(Enable::Off) => "off",
            Some(Enable::Engage) => "engage",
            Some(Enable::Shadow) => "shadow",
            None => "engage or off",
        })
    }
}

fn write_preference(f: &mut fmt::Formatter<'_>, weight: f32) -> fmt::Result {
    if (0.0..=1.0).contains(&weight) {
        write!(f, "preference {}", Decimal::<2>(weight))
    } else {
        f.write_str("preference")
    }
}

#[derive(Debug)]
struct Answered {
    command: Command,
    result: CommandResult,
    at: Instant,
}

/// Recent answers, so that a resent command is answered again and not run again.
#[derive(Debug, Default)]
pub(crate) struct Answers {
    recent: Deque<Answered, 8>,
    /// Whether a request to engage was run since the last other choice of `MAV_CMD_USER_2`.
    engage_run: bool,
}

impl Answers {
    /// Longest time between the first transmission and a marked resend (`confirmation` above 0).
    const CONFIRMED: Duration = Duration::from_secs(10);
    /// The same for an unmarked resend without another command of its sender in between: ground stations retry after 3 s.
    const REPEATED: Duration = Duration::from_millis(3_500);

    /// The answer already given if `command` is a resend.
    ///
    /// Only the newest command of a sender can be a resend: off, engage, off are three requests, even if the last is marked
    /// as a resend. Off and return are never resends, because acting twice on them does no harm.
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

    /// Whether `command` repeats a request to engage that has been run, and is no recent resend. Meanwhile the human
    /// pilot may have taken over and selected GUIDED again for another purpose, so it does not engage.
    pub fn is_stale_engage(&self, command: &Command) -> bool {
        self.engage_run && command.confirmation > 0 && enable_of(command) == Some(Enable::Engage)
    }

    /// Remembers an answer.
    pub fn remember(&mut self, now: Instant, command: Command, result: CommandResult) {
        if let Some(enable) = enable_of(&command)
            && result == CommandResult::Accepted
        {
            self.engage_run = enable == Enable::Engage;
        }
        if self.recent.is_full() {
            let _ = self.recent.pop_front();
        }
        let _ = self.recent.push_back(Answered { command, result, at: now });
    }
}

/// Off and return take the aircraft out of our hands or home, and act however often they arrive.
fn is_always_run(command: &Command) -> bool {
    is(command, MavCmd::MAV_CMD_USER_3) || enable_of(command) == Some(Enable::Off)
}

/// What a `MAV_CMD_USER_2` chooses.
fn enable_of(command: &Command) -> Option<Enable> {
    let [first, ..] = command.params;
    if is(command, MavCmd::MAV_CMD_USER_2) { Enable::from_value(first) } else { None }
}
