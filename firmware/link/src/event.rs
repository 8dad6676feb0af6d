//! What a component tells its owner.

use crate::{AutopilotCommand, Change, Failsafe, FlightMode, OperatorRequest, Outcome};
use heapless::{Deque, Vec};

pub(crate) const TUNNEL_BYTES: usize = 128;

/// Payload of a `TUNNEL` message.
pub type TunnelPayload = Vec<u8, TUNNEL_BYTES>;

/// Something that happened, in the order in which it did.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The operator asked for something, by command or by the parameter that means the same. Already
    /// acknowledged and already in [`crate::Parameters`].
    Operator(OperatorRequest),
    /// A parameter without an operator request of its own was set.
    Parameter(Change),
    /// The first heartbeat of the autopilot, or the first after it was lost.
    AutopilotConnected,
    /// No heartbeat of the autopilot for five seconds.
    AutopilotLost,
    /// The autopilot's clock went back: it started again, and everything known of it was forgotten.
    AutopilotRebooted,
    /// The autopilot reports another mode (also the first one after it connected).
    ModeChanged(FlightMode),
    /// The motors were armed or disarmed (also the first report).
    ArmedChanged(bool),
    /// A failsafe of the autopilot began. None is reported for its end.
    FailsafeBegan(Failsafe),
    /// A command of ours to the autopilot came to its end.
    RequestEnded {
        /// What was asked.
        command: AutopilotCommand,
        /// How it ended.
        outcome: Outcome,
    },
    /// Bytes of a radio report ([`crate::TUNNEL_RADIO_REPORT`]).
    RadioReport(TunnelPayload),
}

/// Events not yet taken. Radio reports may take half of the room only, so that a flood of them never costs an
/// operator's request.
#[derive(Debug, Default)]
pub(crate) struct Events {
    queue: Deque<Event, 24>,
    pub dropped: u32,
}

impl Events {
    /// Room that every batch of consequences of one message fits in.
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

    /// Whether the consequences of one more operator message surely fit.
    pub fn has_room(&self) -> bool {
        self.queue.len() + Events::MARGIN <= self.queue.storage_capacity()
    }
}
