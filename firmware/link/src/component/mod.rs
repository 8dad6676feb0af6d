//! The component as a whole: bytes in, bytes out, events to its owner.

mod answering;
mod blocks;
mod sending;

pub use self::sending::FILE_DATA_BYTES;

use self::blocks::Duplicate;

use crate::address::Address;
use crate::autopilot_command::AutopilotCommand;
use crate::event::{Event, Events};
use crate::message::SystemState;
use crate::message::{Message, MessageFault, Severity};
use crate::operators::Operators;
use crate::parameters::{ParameterError, ParameterId, Parameters};
use crate::service::autopilot::{Autopilot, is_autopilot, mode_of};
use crate::service::commands::Answers;
use crate::service::identity::Identity;
use crate::service::parameters::ParameterService;
use crate::service::requests::Requests;
use crate::service::steering::Steering;
use crate::service::texts::{Strangers, Texts};
use crate::setpoint::PositionTarget;
use crate::settings::{EngageBlock, LinkStats, NotSent, Settings, Status};
use crate::wire::decoder::FrameDecoder;
use crate::wire::frame::Frame;
use crate::wire::outgoing::Outgoing;
use core::fmt;
use gleaner_units::{Duration, Instant, Ned};
use heapless::String;
use mavlink::dialects::ardupilotmega::MavCmd;

/// The last `GLN_ENABLE` that was set from outside.
#[derive(Clone, Copy, Debug)]
struct EnableSet {
    sender: Address,
    value: f32,
    at: Instant,
}

/// Where a ground station finds the component's metadata (MAVLink guide, "Component Metadata Protocol").
#[derive(Clone, Debug)]
struct Metadata {
    uri: String<100>,
    crc: u32,
}

/// One MAVLink component on one link.
///
/// Call [`Component::receive`] with the bytes that arrived, [`Component::poll`] from the decision loop, take the
/// events, and send what [`Component::transmit`] returns.
#[derive(Debug)]
pub struct Component {
    decoder: FrameDecoder,
    outgoing: Outgoing,
    identity: Identity,
    operators: Operators,
    autopilot: Autopilot,
    parameters: Parameters,
    parameter_service: ParameterService,
    answers: Answers,
    requests: Requests,
    texts: Texts,
    strangers: Strangers,
    events: Events,
    owner: Status,
    steering: Steering,
    revocations: u32,
    enable_set: Option<EnableSet>,
    duplicate: Duplicate,
    block: Option<EngageBlock>,
    metadata: Option<Metadata>,
    started_at: Option<Instant>,
    heartbeat_at: Option<Instant>,
    stats: LinkStats,
}

impl Component {
    /// After this long without any autopilot the first system id is used, so that routers learn of us.
    const PATIENCE: Duration = Duration::from_secs(5);
    const HEARTBEAT_PERIOD: Duration = Duration::from_secs(1);
    /// A component before the first byte.
    #[must_use]
    pub fn new(settings: Settings, parameters: Parameters) -> Component {
        Component {
            decoder: FrameDecoder::new(),
            outgoing: Outgoing::new(),
            identity: Identity::new(settings.system, settings.component),
            operators: settings.operators,
            autopilot: Autopilot::default(),
            parameters,
            parameter_service: ParameterService::default(),
            answers: Answers::default(),
            requests: Requests::default(),
            texts: Texts::default(),
            strangers: Strangers::default(),
            events: Events::default(),
            owner: Status { state: SystemState::Boot, may_engage: false, may_return: false },
            steering: Steering::default(),
            revocations: 0,
            enable_set: None,
            duplicate: Duplicate::default(),
            block: None,
            metadata: None,
            started_at: None,
            heartbeat_at: None,
            stats: LinkStats::default(),
        }
    }

    /// Takes in bytes of a stream: a serial line or a TCP connection.
    pub fn receive(&mut self, now: Instant, mut bytes: &[u8]) {
        while let Some(frame) = self.decoder.read(&mut bytes) {
            self.receive_frame(now, &frame);
        }
    }

    /// Takes in one datagram. Frames do not continue in the next one.
    pub fn receive_datagram(&mut self, now: Instant, bytes: &[u8]) {
        self.decoder.begin_datagram();
        self.receive(now, bytes);
    }

    /// Takes in one frame of a decoder of the program's own: one decoder per port, so that the bytes of several ports
    /// do not mix, and signatures can be verified first ([`crate::Signing`]).
    pub fn receive_frame(&mut self, now: Instant, frame: &Frame) {
        match Message::decode(frame) {
            Ok(Some(message)) => self.take(now, frame, &message),
            Ok(None) => count(&mut self.stats.not_needed),
            Err(MessageFault::Malformed) => count(&mut self.stats.malformed),
            Err(MessageFault::NotFinite | MessageFault::NotOnTheGlobe) => {
                count(&mut self.stats.bad_coordinates);
            }
        }
    }

    /// Runs everything that depends on time: heartbeat, parameters, texts, requests, streams. Several times a
    /// second, from the decision loop and from nowhere else.
    pub fn poll(&mut self, now: Instant, status: &Status) {
        self.owner = *status;
        let started_at = *self.started_at.get_or_insert(now);
        if let Some(settled) = self.identity.poll(now) {
            self.report_identity(settled);
        }
        self.watch_block(now);
        let wants_rc = self.parameters.data_weight_channel().is_some();
        self.autopilot.poll(now, wants_rc, &mut self.outgoing, &mut self.events);
        match self.autopilot.address().filter(|_| self.autopilot.is_connected()) {
            Some(address) => {
                let ours_at = self.autopilot.ours_at(now);
                self.requests.poll(now, address, ours_at, &mut self.outgoing, &mut self.events);
            }
            None => self.requests.abandon(&mut self.events),
        }
        let speaks = self.identity.is_settled() || now.since(started_at) >= Component::PATIENCE;
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

    /// State of the autopilot.
    #[must_use]
    pub const fn autopilot(&self) -> &Autopilot {
        &self.autopilot
    }

    /// The parameters' values.
    #[must_use]
    pub const fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Sets a parameter from within and broadcasts its value. Makes no event.
    ///
    /// # Errors
    /// As [`Parameters::set_id`].
    pub fn set_parameter(&mut self, id: ParameterId, value: f32) -> Result<(), ParameterError> {
        self.parameters.set_id(id, value)?;
        self.parameter_service.send(id);
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
        self.steering.sent(now, *target);
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

    /// A target that is not ours and that the autopilot followed since we began to steer.
    #[must_use]
    pub const fn foreign_target(&self) -> Option<Ned> {
        self.steering.foreign()
    }

    /// Whether the autopilot reported the target that it follows since the last call. A target of ours that leaves right
    /// after such a report replaces no target that was not reported.
    pub fn take_target_report(&mut self) -> bool {
        self.steering.take_reported()
    }

    /// Whether a heartbeat since the last call showed a mode in which we do not steer.
    pub fn take_other_mode(&mut self) -> bool {
        self.autopilot.take_other_mode()
    }

    /// Sends a command to the autopilot, up to three times until it is acknowledged. Ends with
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

    /// Why the link refuses to engage now, if it does. As of the last poll.
    #[must_use]
    pub const fn engage_block(&self) -> Option<EngageBlock> {
        self.block
    }

    /// Names the general metadata file for ground stations: its URI of at most 100 bytes and its checksum
    /// ([`crate::metadata::checksum`]). False if the URI is too long. Without it, requests for `COMPONENT_METADATA` are
    /// denied.
    pub fn set_metadata(&mut self, uri: &str, crc: u32) -> bool {
        self.metadata = String::try_from(uri).ok().map(|uri| Metadata { uri, crc });
        self.metadata.is_some()
    }

    /// One message of `frame`.
    fn take(&mut self, now: Instant, frame: &Frame, message: &Message) {
        let (own, sender) = (self.identity.own(), frame.sender);
        if sender == own {
            self.watch_own_id(now, frame, message);
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
        // A late frame may show another mode; it does not show that ours still holds.
        let outdated = matches!(message, Message::Heartbeat(heartbeat)
            if frame.late && mode_of(heartbeat).companion_may_steer());
        if self.identity.serves(sender.system) && !outdated {
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
