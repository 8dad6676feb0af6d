//! Who has the aircraft, from what was delivered to the pilot and what left it.
//!
//! ```text
//!            engage request            first decision
//!   Unclaimed ---------------> Asked ------------------> Pilot
//!     ^                          ^                         | another mode delivered, restart,
//!     |                          |  engage request         v another station's targets in force
//!     +-- (boot)                 +---------------------- Other
//! ```
//! Changes of custody count from the time of delivery, because the pilot cannot react before it. Evidence counts from the
//! time at which it left the autopilot.

use super::rules::Rule;
use crate::autopilot::{AutopilotKind, Commander, Truth, VehicleMode};
use crate::line::message_id;
use crate::wire::parse;
use gleaner_link::{Frame, FrameDecoder, MAX_FRAME_BYTES};
use gleaner_units::{Duration, Instant};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, HEARTBEAT_DATA, MavCmd, MavState, PARAM_SET_DATA, SET_POSITION_TARGET_LOCAL_NED_DATA,
};

/// Who may move the aircraft, by what was delivered to the pilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Holder {
    Unclaimed,
    Asked(Instant),
    Pilot,
    Other,
}

/// A frame from the companion that moves the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Target,
    Land,
    Return,
    /// Another mode request, with its `custom_mode`.
    Mode(u32),
    Other,
}

/// The custody of one flight.
#[derive(Clone, Debug)]
pub(super) struct Custody {
    kind: AutopilotKind,
    system_id: u8,
    component_id: u8,
    holder: Holder,
    /// When the last heartbeat in GUIDED or OFFBOARD left the autopilot.
    evidence_at: Option<Instant>,
    /// Commands need evidence that is newer than this: the end of a stall.
    evidence_after: Instant,
    /// LAND or RTL that the pilot asked for.
    own_request: Option<VehicleMode>,
    failsafe_delivered: bool,
    foreign_since: Option<Instant>,
    noise: Noise,
    /// Factor between the aircraft's time and the pilot's.
    speedup: f32,
}

/// What a receiver makes of a noisy line. A damaged length hides the frames behind it until so many bytes have come, so that a
/// heartbeat on the line is not yet one that the pilot has.
#[derive(Clone, Debug, Default)]
struct Noise {
    until: Instant,
    /// Bytes after which the receiver is in step again.
    bytes_left: usize,
    receiver: FrameDecoder,
}

impl Noise {
    /// Noise costs at most the frames that begin within this many bytes after it ([`FrameDecoder`]).
    const REACH_BYTES: usize = 2 * MAX_FRAME_BYTES;

    /// Takes in bytes. Returns whether they were read as a stream; `frames` are the ones that it completed.
    fn receive(&mut self, now: Instant, bytes: &[u8], frames: &mut Vec<Frame>) -> bool {
        if now < self.until {
            self.bytes_left = Noise::REACH_BYTES;
        }
        if self.bytes_left == 0 {
            return false;
        }
        self.bytes_left = self.bytes_left.saturating_sub(bytes.len());
        let mut rest = bytes;
        frames.extend(std::iter::from_fn(|| self.receiver.read(&mut rest)));
        if self.bytes_left == 0 {
            self.receiver = FrameDecoder::new();
        }
        true
    }
}

/// Heartbeats are a second apart; half a second for the line.
const EVIDENCE_AGE_S: f32 = 1.5;
/// A request to engage expires after 60 s; the rest is the referee's tolerance.
const REQUEST_AGE_S: f32 = 75.0;
/// A target that is in force for this time was reported to the pilot at least twice (5 Hz).
const REPORTED_S: f32 = 0.5;
/// The pilot must have noticed the targets of another station after this time.
const FOREIGN_TARGET_S: f32 = 5.0;

impl Custody {
    pub fn new(kind: AutopilotKind, system_id: u8, component_id: u8, speedup: f32) -> Custody {
        Custody {
            kind,
            system_id,
            component_id,
            holder: Holder::Unclaimed,
            evidence_at: None,
            evidence_after: Instant::ZERO,
            own_request: None,
            failsafe_delivered: false,
            foreign_since: None,
            noise: Noise::default(),
            speedup,
        }
    }

    fn scaled(&self, seconds: f32) -> Duration {
        Duration::from_secs_f32(seconds * self.speedup)
    }

    /// Whether the aircraft was taken over since the last request to engage.
    pub fn is_revoked(&self) -> bool {
        self.holder == Holder::Other
    }

    /// A frame was delivered to the pilot that left the autopilot (or entered the line) at `left_at`.
    pub fn delivered(&mut self, left_at: Instant, bytes: &[u8]) {
        let mut frames = Vec::new();
        if self.noise.receive(left_at, bytes, &mut frames) {
            frames.iter().for_each(|frame| self.received(left_at, frame));
            return;
        }
        if !matches!(message_id(bytes), Some(HEARTBEAT_DATA::ID | COMMAND_LONG_DATA::ID | PARAM_SET_DATA::ID))
        {
            return;
        }
        if let Some(frame) = FrameDecoder::new().read(&mut &*bytes) {
            self.received(left_at, &frame);
        }
    }

    fn received(&mut self, left_at: Instant, frame: &Frame) {
        if let Some(heartbeat) = parse::<HEARTBEAT_DATA>(frame) {
            if (frame.sender.system, frame.sender.component) == (self.system_id, 1) {
                self.heartbeat(left_at, &heartbeat);
            }
        } else if self.is_engage_request(frame) {
            self.holder = Holder::Asked(left_at);
            self.own_request = None;
            self.foreign_since = None;
        } else if self.is_off_request(frame) {
            // The operator may take the aircraft back at any time.
            self.holder = Holder::Other;
        }
    }

    /// Bytes on the line to the pilot are damaged until then.
    pub fn noisy_until(&mut self, until: Instant) {
        self.noise.until = self.noise.until.max(until);
    }

    fn heartbeat(&mut self, left_at: Instant, heartbeat: &HEARTBEAT_DATA) {
        let mode = VehicleMode::from_custom_mode(self.kind, heartbeat.custom_mode);
        self.failsafe_delivered = heartbeat.system_status == MavState::MAV_STATE_CRITICAL;
        if mode == Some(VehicleMode::Guided) {
            self.evidence_at = Some(left_at);
        } else if self.holder == Holder::Pilot && mode != self.own_request {
            self.holder = Holder::Other;
        }
    }

    /// Only the operator's station may command; the second station and hostile ones may not.
    fn is_operators(&self, frame: &Frame) -> bool {
        matches!(frame.sender.system, 254 | 255)
    }

    fn is_engage_request(&self, frame: &Frame) -> bool {
        let command = parse::<COMMAND_LONG_DATA>(frame).is_some_and(|command| {
            command.command == MavCmd::MAV_CMD_USER_2
                && command.param1 == 1.0
                && command.confirmation == 0
                && command.target_component == self.component_id
        });
        let parameter = parse::<PARAM_SET_DATA>(frame).is_some_and(|set| {
            set.param_id.to_str() == Ok("GLN_ENABLE")
                && set.param_value == 1.0
                && set.target_component == self.component_id
        });
        self.is_operators(frame) && (command || parameter)
    }

    fn is_off_request(&self, frame: &Frame) -> bool {
        let command = parse::<COMMAND_LONG_DATA>(frame);
        self.is_operators(frame)
            && command.is_some_and(|command| {
                command.command == MavCmd::MAV_CMD_USER_2
                    && command.param1 != 1.0
                    && command.target_component == self.component_id
            })
    }

    /// The pilot's program ended and starts again: a new one has no permission.
    pub fn restarted(&mut self) {
        self.holder = Holder::Other;
        self.own_request = None;
    }

    /// The program does not run until `until`. What arrives meanwhile is no evidence.
    pub fn stalled_until(&mut self, until: Instant) {
        self.evidence_after = until;
    }

    /// A decision that is flown left the pilot.
    pub fn decided(&mut self, now: Instant) -> Option<Rule> {
        match self.holder {
            Holder::Asked(at) => {
                self.holder = Holder::Pilot;
                (now - at > self.scaled(REQUEST_AGE_S)).then_some(Rule::RequestExpired)
            }
            Holder::Pilot => None,
            Holder::Unclaimed => Some(Rule::NeverAsked),
            Holder::Other => Some(Rule::TookItBack),
        }
    }

    /// Ground truth, once a step. Another station whose target has been in force for [`FOREIGN_TARGET_S`] has the
    /// aircraft.
    pub fn watch(&mut self, now: Instant, truth: &Truth) {
        let foreign = truth.mode == VehicleMode::Guided && truth.target_by == Some(Commander::Operator);
        if self.holder == Holder::Pilot && foreign {
            self.foreign_since.get_or_insert(now);
        } else if self.foreign_since.is_some_and(|since| now - since < self.scaled(REPORTED_S)) {
            // Replaced before the autopilot reported it: the pilot cannot know.
            self.foreign_since = None;
        }
        if self.holder == Holder::Pilot && foreign && self.is_foreign(now) {
            self.holder = Holder::Other;
        }
    }

    fn is_foreign(&self, now: Instant) -> bool {
        self.foreign_since.is_some_and(|since| now - since > self.scaled(FOREIGN_TARGET_S))
    }

    /// A frame left the pilot. The rule that it breaks, if any.
    pub fn sent(&mut self, now: Instant, frame: &Frame) -> Option<Rule> {
        let motion = motion(self.kind, frame)?;
        if let Motion::Mode(custom_mode) = motion
            && VehicleMode::from_custom_mode(self.kind, custom_mode) == Some(VehicleMode::Guided)
        {
            return Some(Rule::AskedForGuided);
        }
        if motion == Motion::Target {
            return self.target_sent(now);
        }
        match self.holder {
            Holder::Unclaimed | Holder::Asked(_) => return Some(Rule::NeverAsked),
            Holder::Other => return Some(Rule::CommandAfterTakeOver),
            Holder::Pilot => {}
        }
        self.own_request = match motion {
            Motion::Land => Some(VehicleMode::Land),
            Motion::Return => Some(VehicleMode::Return),
            Motion::Mode(custom_mode) => VehicleMode::from_custom_mode(self.kind, custom_mode),
            Motion::Target | Motion::Other => self.own_request,
        };
        let fresh = self
            .evidence_at
            .is_some_and(|at| at >= self.evidence_after && now - at <= self.scaled(EVIDENCE_AGE_S));
        (!fresh).then_some(Rule::StaleEvidence)
    }

    fn target_sent(&self, now: Instant) -> Option<Rule> {
        match self.holder {
            Holder::Pilot | Holder::Other if self.is_foreign(now) => Some(Rule::OverwroteTarget),
            Holder::Pilot => None,
            // PX4 accepts OFFBOARD only with a stream; during a failsafe the stream itself would bring it back.
            Holder::Asked(_) if self.kind == AutopilotKind::Px4 => {
                self.failsafe_delivered.then_some(Rule::StreamInFailsafe)
            }
            // On ArduPilot the first target follows the decision in the same poll.
            Holder::Asked(_) => None,
            Holder::Unclaimed => Some(Rule::NeverAsked),
            Holder::Other => Some(Rule::TargetAfterTakeOver),
        }
    }
}

fn motion(kind: AutopilotKind, frame: &Frame) -> Option<Motion> {
    if frame.message_id == SET_POSITION_TARGET_LOCAL_NED_DATA::ID {
        return Some(Motion::Target);
    }
    // SET_POSITION_TARGET_GLOBAL_INT, SET_ATTITUDE_TARGET, SET_MODE, RC_CHANNELS_OVERRIDE, MANUAL_CONTROL.
    if matches!(frame.message_id, 86 | 82 | 11 | 70 | 69) {
        return Some(Motion::Other);
    }
    let command = parse::<COMMAND_LONG_DATA>(frame)?;
    // Commands to other components, such as answers to a ground station, move nothing.
    if command.target_component > 1 {
        return None;
    }
    Some(match command.command {
        MavCmd::MAV_CMD_NAV_LAND => Motion::Land,
        MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => Motion::Return,
        MavCmd::MAV_CMD_DO_SET_MODE => {
            // ArduPilot: the number in param2. PX4: main mode in param2, sub mode in param3.
            let (main, sub) = (command.param2 as u32, command.param3 as u32);
            Motion::Mode(match kind {
                AutopilotKind::ArduPilot => main,
                AutopilotKind::Px4 => main << 16 | sub << 24,
            })
        }
        MavCmd::MAV_CMD_NAV_TAKEOFF
        | MavCmd::MAV_CMD_COMPONENT_ARM_DISARM
        | MavCmd::MAV_CMD_DO_REPOSITION
        | MavCmd::MAV_CMD_MISSION_START => Motion::Other,
        _ => return None,
    })
}
