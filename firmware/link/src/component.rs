//! The component as a whole: bytes in, bytes out, events to its owner.

mod answering;
mod sending;

use crate::autopilot::is_autopilot;
use crate::commands::Answers;
use crate::event::Events;
use crate::identity::{Identity, Settled};
use crate::parameter_service::ParameterService;
use crate::requests::Requests;
use crate::steering::Steering;
use crate::text::Texts;
use crate::{
    Address, Autopilot, AutopilotCommand, DecodeStats, Event, FrameDecoder, Message, MessageFault, Outgoing,
    OutgoingStats, ParameterError, ParameterId, Parameters, PositionTarget, Severity, SystemState,
    TargetError,
};
use core::fmt;
use gleaner_units::{Duration, Instant, Ned};
use mavlink::dialects::ardupilotmega::MavCmd;

/// Who we are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    system: u8,
    component: u8,
}

/// Why settings are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingsError {
    /// System ids are 1..254: 0 is everyone, 255 is the ground station.
    System,
    /// Component ids are 2..255: 0 is everyone, 1 is the autopilot.
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
    /// System 1, component 191 (`MAV_COMP_ID_ONBOARD_COMPUTER`).
    fn default() -> Settings {
        Settings { system: 1, component: 191 }
    }
}

impl Settings {
    /// `system` is used until a vehicle's id is adopted, and when several vehicles are heard.
    ///
    /// # Errors
    /// See [`SettingsError`].
    pub const fn new(system: u8, component: u8) -> Result<Settings, SettingsError> {
        if system == 0 || system == 255 {
            return Err(SettingsError::System);
        }
        if component < 2 {
            return Err(SettingsError::Component);
        }
        Ok(Settings { system, component })
    }
}

/// What the owner of the component is, told with every poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// Goes into the heartbeat.
    pub state: SystemState,
    /// While false, the command to engage is temporarily rejected.
    pub may_engage: bool,
    /// While false, the command to return is denied.
    pub may_return: bool,
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
    /// Commands left unanswered for want of room; their senders try again.
    pub commands_postponed: u32,
    /// Events dropped because the owner did not take them.
    pub events_dropped: u32,
    /// Status texts dropped for want of room.
    pub texts_dropped: u32,
}

/// The last `GLN_ENABLE` that was set from outside.
#[derive(Clone, Copy, Debug)]
struct EnableSet {
    sender: Address,
    value: f32,
    at: Instant,
}

/// One MAVLink component on one link.
///
/// Call [`Component::receive`] with what arrived, [`Component::poll`] from the decision loop, take the events,
/// and [`Component::transmit`] what is to leave.
#[derive(Debug)]
pub struct Component {
    decoder: FrameDecoder,
    outgoing: Outgoing,
    identity: Identity,
    autopilot: Autopilot,
    parameters: Parameters,
    parameter_service: ParameterService,
    answers: Answers,
    requests: Requests,
    texts: Texts,
    events: Events,
    owner: Status,
    steering: Steering,
    revocations: u32,
    enable_set: Option<EnableSet>,
    started_at: Option<Instant>,
    heartbeat_at: Option<Instant>,
    stats: LinkStats,
}

impl Component {
    /// After this long without any autopilot the configured system id is used, so that routers let us in.
    const PATIENCE: Duration = Duration::from_secs(5);
    const HEARTBEAT_PERIOD: Duration = Duration::from_secs(1);

    /// A component that has heard and said nothing.
    #[must_use]
    pub fn new(settings: Settings, parameters: Parameters) -> Component {
        Component {
            decoder: FrameDecoder::new(),
            outgoing: Outgoing::new(),
            identity: Identity::new(Address::new(settings.system, settings.component)),
            autopilot: Autopilot::default(),
            parameters,
            parameter_service: ParameterService::default(),
            answers: Answers::default(),
            requests: Requests::default(),
            texts: Texts::default(),
            events: Events::default(),
            owner: Status { state: SystemState::Boot, may_engage: false, may_return: false },
            steering: Steering::default(),
            revocations: 0,
            enable_set: None,
            started_at: None,
            heartbeat_at: None,
            stats: LinkStats::default(),
        }
    }

    /// Takes in bytes of the link.
    pub fn receive(&mut self, now: Instant, mut bytes: &[u8]) {
        loop {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or(&[]);
            while let Some(frame) = self.decoder.next_frame() {
                match Message::decode(&frame) {
                    Ok(Some(message)) => self.take(now, frame.sender, &message),
                    Ok(None) => count(&mut self.stats.not_needed),
                    Err(MessageFault::Malformed) => count(&mut self.stats.malformed),
                    Err(MessageFault::NotFinite | MessageFault::NotOnTheGlobe) => {
                        count(&mut self.stats.bad_coordinates);
                    }
                }
            }
            if bytes.is_empty() {
                return;
            }
        }
    }

    /// Runs everything that depends on time: heartbeat, parameters, texts, requests, streams. Several times a
    /// second, from the decision loop and from nowhere else.
    pub fn poll(&mut self, now: Instant, status: &Status) {
        self.owner = *status;
        let started_at = *self.started_at.get_or_insert(now);
        if let Some(settled) = self.identity.poll(now) {
            self.tell_identity(settled);
        }
        let wants_rc = self.parameters.data_weight_channel().is_some();
        self.autopilot.poll(now, wants_rc, &mut self.outgoing, &mut self.events);
        match self.autopilot.address().filter(|_| self.autopilot.is_connected()) {
            Some(address) => {
                let ours_at = self.autopilot.ours_at();
                self.requests.poll(now, address, ours_at, &mut self.outgoing, &mut self.events);
            }
            None => self.requests.abandon(&mut self.events),
        }
        let speaks = self.identity.settled().is_some() || now.since(started_at) >= Component::PATIENCE;
        if speaks {
            self.poll_heartbeat(now, status.state);
            self.parameter_service.poll(&self.parameters, &mut self.outgoing);
            self.texts.poll(now, &mut self.outgoing);
        }
    }

    /// The next event.
    pub fn next_event(&mut self) -> Option<Event> {
        self.events.pop()
    }

    /// Fills `out` with bytes for the link and returns how many.
    pub fn transmit(&mut self, out: &mut [u8]) -> usize {
        self.outgoing.transmit(self.identity.own(), out)
    }

    /// Our address as it is now.
    #[must_use]
    pub const fn address(&self) -> Address {
        self.identity.own()
    }

    /// What is known of the autopilot.
    #[must_use]
    pub const fn autopilot(&self) -> &Autopilot {
        &self.autopilot
    }

    /// The parameters' values.
    #[must_use]
    pub const fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Sets a parameter from within and tells everyone. Makes no event.
    ///
    /// # Errors
    /// As [`Parameters::set_id`].
    pub fn set_parameter(&mut self, id: ParameterId, value: f32) -> Result<(), ParameterError> {
        self.parameters.set_id(id, value)?;
        self.parameter_service.tell(id);
        Ok(())
    }

    /// Sends a position target; one that has not left yet is replaced.
    ///
    /// # Errors
    /// See [`NotSent`].
    pub fn steer(&mut self, now: Instant, target: &PositionTarget) -> Result<(), NotSent> {
        self.send_setpoint(now, target)?;
        if !self.autopilot.companion_may_steer() {
            // PX4 before OFFBOARD: it follows targets of its own, and ours are not in force yet.
            self.steering.end();
        }
        self.steering.sent(now, target.position);
        Ok(())
    }

    /// Withdraws every target and request of ours, without events: after a take-over nothing may leave and nothing may
    /// be repeated. The program must drop the bytes that it holds as well, see [`Component::revocations`].
    pub fn revoke(&mut self) {
        self.outgoing.revoke();
        self.requests = Requests::default();
        self.steering.end();
        self.revocations = self.revocations.wrapping_add(1);
    }

    /// How often targets and requests were revoked. When it changes, frames that were taken by [`Component::transmit`]
    /// and have not left yet must not leave any more.
    #[must_use]
    pub const fn revocations(&self) -> u32 {
        self.revocations
    }

    /// The target of someone else that the autopilot followed since we began to steer.
    #[must_use]
    pub const fn foreign_target(&self) -> Option<Ned> {
        self.steering.foreign()
    }

    /// Whether a heartbeat since the last call showed a mode in which we do not steer.
    pub fn take_other_mode(&mut self) -> bool {
        self.autopilot.take_other_mode()
    }

    /// Asks something of the autopilot, three times in three seconds, until it answers; ends with
    /// [`Event::RequestEnded`].
    ///
    /// # Errors
    /// See [`NotSent`].
    pub fn request(&mut self, now: Instant, command: AutopilotCommand) -> Result<(), NotSent> {
        if !command.is_finite() {
            return Err(NotSent::NotFinite);
        }
        if !self.autopilot.is_connected() {
            return Err(NotSent::NoAutopilot);
        }
        self.requests.begin(now, command, &mut self.events);
        Ok(())
    }

    /// Queues a status text of at most 150 bytes; more than 50 leave as several messages.
    pub fn say(&mut self, severity: Severity, text: fmt::Arguments<'_>) {
        self.texts.say(severity, text);
    }

    /// The counters.
    #[must_use]
    pub fn stats(&self) -> LinkStats {
        LinkStats {
            decode: self.decoder.stats(),
            outgoing: self.outgoing.stats(),
            events_dropped: self.events.dropped,
            texts_dropped: self.texts.dropped,
            ..self.stats
        }
    }

    fn tell_identity(&mut self, settled: Settled) {
        let own = self.identity.own();
        match settled {
            Settled::Adopted(system) => {
                self.say(
                    Severity::Info,
                    format_args!("gleaner: system {system}, component {}", own.component),
                );
            }
            Settled::Several => {
                self.say(
                    Severity::Warning,
                    format_args!("gleaner: several autopilots heard, serving system {}", own.system),
                );
            }
        }
    }

    /// One message with its sender.
    fn take(&mut self, now: Instant, sender: Address, message: &Message) {
        let own = self.identity.own();
        if sender == own {
            return;
        }
        if let Message::Heartbeat(heartbeat) = message
            && is_autopilot(heartbeat)
        {
            self.identity.hear(now, sender.system);
        }
        if !message.target().reaches(own) {
            count(&mut self.stats.for_others);
            return;
        }
        if self.identity.settled().is_some() && sender.system == own.system {
            self.take_from_vehicle(now, sender, message);
        }
        self.answer(now, sender, message);
    }

    fn take_from_vehicle(&mut self, now: Instant, sender: Address, message: &Message) {
        self.autopilot.observe(now, sender, message, &mut self.events);
        if let Message::FollowedTarget(target) = message
            && self.autopilot.address() == Some(sender)
        {
            let origin = self.autopilot.origin().map(|origin| origin.point);
            self.steering.follows(now, target, origin);
        }
        if let Message::CommandAck(ack) = message
            && self.autopilot.address() == Some(sender)
        {
            if u32::from(ack.command) == MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL as u32 {
                self.autopilot.interval_answered(now, ack.result);
            }
            self.requests.acknowledged(now, ack, &mut self.events);
        }
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
