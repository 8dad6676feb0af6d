//! What the owner of a component gives it and learns from it.

use crate::message::SystemState;
use crate::operators::Operators;
use crate::setpoint::TargetError;
use crate::wire::decoder::DecodeStats;
use crate::wire::outgoing::OutgoingStats;
use core::fmt;

/// Ids of the component, and who may command it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    pub(crate) system: Option<u8>,
    pub(crate) component: u8,
    pub(crate) operators: Operators,
}

/// Why settings are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingsError {
    /// System ids are 1..254: 0 means all systems, 255 is the ground station.
    System,
    /// Component ids are 2..255: 0 means all components, 1 is the autopilot.
    Component,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SettingsError::System => write!(f, "the system id must be 1..254"),
            SettingsError::Component => write!(f, "the component id must be 2..255"),
        }
    }
}

impl core::error::Error for SettingsError {}

impl Default for Settings {
    /// The system id of the only autopilot heard, component 191 (`MAV_COMP_ID_ONBOARD_COMPUTER`), and the operators of
    /// [`Operators::default`].
    fn default() -> Settings {
        Settings { system: None, component: 191, operators: Operators::default() }
    }
}

impl Settings {
    /// `system` is the id of the vehicle to serve; without it, the id of the only autopilot heard is adopted.
    ///
    /// # Errors
    /// See [`SettingsError`].
    pub fn new(system: Option<u8>, component: u8) -> Result<Settings, SettingsError> {
        if matches!(system, Some(0 | 255)) {
            return Err(SettingsError::System);
        }
        if component < 2 {
            return Err(SettingsError::Component);
        }
        Ok(Settings { system, component, operators: Operators::default() })
    }

    /// With this allow-list.
    #[must_use]
    pub fn with_operators(self, operators: Operators) -> Settings {
        Settings { operators, ..self }
    }
}

/// State of the component's owner, given with every poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// Goes into the heartbeat.
    pub state: SystemState,
    /// While false, the command to engage is temporarily rejected.
    pub may_engage: bool,
    /// While false, the command to return is denied.
    pub may_return: bool,
}

/// Why the link refuses to engage in every state of the owner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EngageBlock {
    /// Another component sends with our ids.
    DuplicateId,
    /// Several autopilots are heard and the settings do not name one. Holds a system id other than ours.
    SeveralAutopilots(u8),
    /// The vehicle is no multirotor. Holds its `MAV_TYPE`.
    NotMultirotor(u8),
}

impl fmt::Display for EngageBlock {
    /// At most 30 characters, so that it fits into a status text.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EngageBlock::DuplicateId => f.write_str("our id is used twice"),
            EngageBlock::SeveralAutopilots(_) => f.write_str("several autopilots"),
            EngageBlock::NotMultirotor(vehicle) => write!(f, "MAV_TYPE {vehicle}: no multirotor"),
        }
    }
}

/// Why something was not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSent {
    /// No autopilot is connected.
    NoAutopilot,
    /// A number is NaN or infinite.
    NotFinite,
}

impl From<TargetError> for NotSent {
    fn from(error: TargetError) -> NotSent {
        match error {
            TargetError::NotFinite => NotSent::NotFinite,
        }
    }
}

/// All counters of a component. They stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkStats {
    /// Framing.
    pub decode: DecodeStats,
    /// Queueing.
    pub outgoing: OutgoingStats,
    /// Messages refused because a field was not allowed.
    pub malformed: u32,
    /// Messages refused because of NaN, infinity or an impossible latitude or longitude.
    pub bad_coordinates: u32,
    /// Messages for others.
    pub for_others: u32,
    /// Messages that we have no use for.
    pub not_needed: u32,
    /// Commands left unanswered because a queue was full; their senders try again.
    pub commands_postponed: u32,
    /// Commands and parameter sets of senders that are not on the allow-list.
    pub not_allowed: u32,
    /// Commands and sets of `GLN_ENABLE` that did not name our system and component.
    pub not_addressed: u32,
    /// Radio reports by `TUNNEL` of senders that are neither of our vehicle nor on the allow-list.
    pub foreign_reports: u32,
    /// Messages with our own ids that we did not send.
    pub duplicate_id: u32,
    /// Events dropped because the owner did not take them.
    pub events_dropped: u32,
    /// Status texts dropped because the queue was full.
    pub texts_dropped: u32,
}
