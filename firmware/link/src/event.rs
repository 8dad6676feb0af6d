//! What a component reports to its owner.

use crate::autopilot_command::AutopilotCommand;
use crate::message::CommandResult;
use crate::mode::FlightMode;
use crate::parameters::{Change, Enable};
use heapless::{Deque, Vec};

/// Bytes of a radio report; the longest has 19.
pub type ReportBytes = Vec<u8, 24>;

/// A request of an operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OperatorRequest {
    /// Weight of data in the preference, 0..1.
    SetPreference(f32),
    /// Off, engage or shadow. A command that asks for the state in force is a new request.
    Enable(Enable),
    /// Fly home now.
    ReturnNow,
}

/// Failsafe that the autopilot reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failsafe {
    /// The heartbeat's system status is critical or worse.
    System,
    /// A battery is low or worse. ArduPilot keeps it until the battery is changed.
    Battery,
}

/// How a command of ours to the autopilot ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The autopilot accepted.
    Accepted,
    /// The autopilot refused.
    Refused(CommandResult),
    /// No acknowledgement after three transmissions.
    NoAnswer,
    /// A newer request of the same kind replaced it.
    Superseded,
}

/// Something that happened. Events are in the order in which they happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// An operator's request, by command or by the parameter that means the same. It is already acknowledged and
    /// already in [`crate::Parameters`].
    Operator(OperatorRequest),
    /// A parameter without a request of its own was set.
    Parameter(Change),
    /// The first heartbeat of the autopilot, or the first after it was lost.
    AutopilotConnected,
    /// No heartbeat of the autopilot for five seconds.
    AutopilotLost,
    /// The autopilot's clock went back: it restarted, and everything known of it was forgotten.
    AutopilotRebooted,
    /// The autopilot reports another mode (also the first one after it connected).
    ModeChanged(FlightMode),
    /// The motors were armed or disarmed (also the first report).
    ArmedChanged(bool),
    /// A failsafe of the autopilot began. Its end is not reported.
    FailsafeBegan(Failsafe),
    /// A command of ours to the autopilot ended.
    RequestEnded {
        /// The command.
        command: AutopilotCommand,
        /// How it ended.
        outcome: Outcome,
    },
    /// Bytes of a radio report ([`crate::TUNNEL_RADIO_REPORT`]) from the vehicle or from an operator.
    RadioReport(ReportBytes),
}

/// Events that the owner has not taken. Radio reports may fill half of the queue, so that a flood of them leaves room
/// for operators' requests.
#[derive(Debug, Default)]
pub(crate) struct Events {
    queue: Deque<Event, 24>,
    pub dropped: u32,
}

impl Events {
    /// Room for all consequences of one message.
    const MARGIN: usize = 6;

    pub fn push(&mut self, event: Event) {
        let limit = match event {
            Event::RadioReport(_) => self.queue.storage_capacity() / 2,
            _ => self.queue.storage_capacity(),
        };
        if self.queue.len() >= limit || self.queue.push_back(event).is_err() {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    pub fn pop(&mut self) -> Option<Event> {
        self.queue.pop_front()
    }

    /// Whether the consequences of one more operator message fit.
    pub fn has_room(&self) -> bool {
        self.queue.len() + Events::MARGIN <= self.queue.storage_capacity()
    }
}
