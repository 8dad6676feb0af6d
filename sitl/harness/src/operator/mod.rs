//! The scripted operator: a ground station that prepares a mission as an operator does, through MAVLink bytes only.
//!
//! ```text
//! ArduPilot: Peers -> Configure -> Ready -> Guided -> Arm -> TakeOff -> Climb -> Engage -> Flying -> Over
//! PX4:       Peers -> Configure -> Ready -> Arm -> TakeOff -> Climb -> Engage -> Offboard -> Flying -> Over
//! ```
//! PX4 accepts OFFBOARD in the air only when targets already stream: the request to engage starts the stream, then
//! the operator selects OFFBOARD. Every request is repeated each second until it is answered.

mod stack;

use crate::autopilot::AutopilotKind;
use crate::wire::{Speaker, parse};
use gleaner_link::{Address, Frame, FrameDecoder, Message, TUNNEL_DECISION};
use gleaner_pilot::{DecisionRecord, State};
use gleaner_units::{Duration, Instant};
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, EKF_STATUS_REPORT_DATA, ESTIMATOR_STATUS_DATA, GLOBAL_POSITION_INT_DATA,
    HEARTBEAT_DATA, HOME_POSITION_DATA, MavAutopilot, MavCmd, MavModeFlag, MavParamType, MavState, MavType,
    PARAM_SET_DATA, PARAM_VALUE_DATA,
};

/// A change of the preference in flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switch {
    /// After the first decision.
    pub after: Duration,
    /// The new weight of data.
    pub w_data: f32,
}

/// The operator's instructions.
#[derive(Clone, Debug, PartialEq)]
pub struct Orders {
    /// System id of the ground station.
    pub station_id: u8,
    /// The vehicle's system id.
    pub system_id: u8,
    /// The pilot's component id.
    pub component_id: u8,
    /// Which autopilot the vehicle has.
    pub autopilot: AutopilotKind,
    /// The pilot's parameters to set, by name.
    pub parameters: Vec<(&'static str, f32)>,
    /// Climb to this height, m.
    pub altitude_m: f32,
    /// Engage the pilot after the climb; otherwise stop there.
    pub engage: bool,
    /// Changes of the preference, in order of time. They go out as `MAV_CMD_USER_1` and as `PARAM_SET` in turn.
    pub switches: Vec<Switch>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Peers,
    Configure(usize),
    Ready,
    Guided,
    Arm,
    TakeOff,
    Climb,
    Engage,
    Offboard,
    Flying,
    Over,
}

/// `MAV_COMP_ID_MISSIONPLANNER`, the component of most ground stations.
const COMPONENT: u8 = 190;
const REPEAT: Duration = Duration::from_secs(1);
/// From the request to engage until the operator selects OFFBOARD.
const STREAM_STARTS: Duration = Duration::from_secs(2);

/// The operator.
#[derive(Debug)]
pub struct Operator {
    orders: Orders,
    speaker: Speaker,
    decoder: FrameDecoder,
    step: Step,
    ask_at: Instant,
    next_heartbeat: Instant,
    autopilot_heard: bool,
    pilot_heard: bool,
    armed: bool,
    mode: u32,
    estimator: u16,
    height_m: f32,
    home_amsl_m: Option<f32>,
    step_since: Instant,
    acknowledged: Option<(u16, u8)>,
    confirmed: Option<(String, f32)>,
    engaged_at: Option<Instant>,
    switched: usize,
    texts: Vec<(Instant, String)>,
}

impl Operator {
    /// An operator at a ground station that was just started.
    #[must_use]
    pub fn new(orders: Orders) -> Operator {
        Operator {
            speaker: Speaker::new(Address::new(orders.station_id, COMPONENT)),
            orders,
            decoder: FrameDecoder::new(),
            step: Step::Peers,
            ask_at: Instant::ZERO,
            next_heartbeat: Instant::ZERO,
            autopilot_heard: false,
            pilot_heard: false,
            armed: false,
            mode: 0,
            estimator: 0,
            height_m: 0.0,
            home_amsl_m: None,
            step_since: Instant::ZERO,
            acknowledged: None,
            confirmed: None,
            engaged_at: None,
            switched: 0,
            texts: Vec::new(),
        }
    }

    /// Bytes from the vehicle.
    pub fn receive(&mut self, now: Instant, mut bytes: &[u8]) {
        while let Some(frame) = self.decoder.read(&mut bytes) {
            self.take_frame(now, &frame);
        }
    }

    /// The frames to send now.
    pub fn poll(&mut self, now: Instant) -> Vec<Vec<u8>> {
        let mut frames = Vec::new();
        if now >= self.next_heartbeat {
            self.next_heartbeat = now + Duration::from_secs(1);
            frames.push(self.speaker.frame(&HEARTBEAT_DATA {
                custom_mode: 0,
                mavtype: MavType::MAV_TYPE_GCS,
                autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
                base_mode: MavModeFlag::empty(),
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            }));
        }
        self.advance(now, &mut frames);
        frames
    }

    /// When the first decision record arrived.
    #[must_use]
    pub const fn engaged_at(&self) -> Option<Instant> {
        self.engaged_at
    }

    /// How many changes of the preference were confirmed.
    #[must_use]
    pub const fn switched(&self) -> usize {
        self.switched
    }

    /// Texts received (`STATUSTEXT`).
    #[must_use]
    pub fn texts(&self) -> &[(Instant, String)] {
        &self.texts
    }

    /// What the operator waits for.
    #[must_use]
    pub fn waiting_for(&self) -> String {
        match self.step {
            Step::Peers if !self.autopilot_heard => "the autopilot's heartbeat".into(),
            Step::Peers => format!("a heartbeat of component {}", self.orders.component_id),
            Step::Configure(index) => format!("the pilot to confirm {}", self.orders.parameters[index].0),
            Step::Ready => "the estimator".into(),
            Step::Guided => "GUIDED".into(),
            Step::Arm => "the motors to be armed".into(),
            Step::TakeOff | Step::Climb => "the climb".into(),
            Step::Engage | Step::Offboard => "the first decision".into(),
            Step::Flying => "the landing".into(),
            Step::Over => "nothing".into(),
        }
    }

    fn take_frame(&mut self, now: Instant, frame: &Frame) {
        if frame.sender.system != self.orders.system_id {
            return;
        }
        let autopilot = frame.sender.component == 1;
        if autopilot && let Some(estimator) = parse::<EKF_STATUS_REPORT_DATA>(frame) {
            self.estimator = estimator.flags.bits();
        } else if autopilot && let Some(estimator) = parse::<ESTIMATOR_STATUS_DATA>(frame) {
            self.estimator = estimator.flags.bits();
        } else if autopilot && let Some(home) = parse::<HOME_POSITION_DATA>(frame) {
            self.home_amsl_m = Some(home.altitude as f32 * 1e-3);
        } else if autopilot && let Some(position) = parse::<GLOBAL_POSITION_INT_DATA>(frame) {
            self.height_m = position.relative_alt as f32 * 1e-3;
        } else if let Some(value) = parse::<PARAM_VALUE_DATA>(frame).filter(|_| !autopilot) {
            let name = value.param_id.to_str().unwrap_or_default().to_owned();
            self.confirmed = Some((name, value.param_value));
        } else if let Ok(Some(message)) = Message::decode(frame) {
            self.take_message(now, autopilot, &message);
        }
    }

    fn take_message(&mut self, now: Instant, autopilot: bool, message: &Message) {
        match message {
            Message::Heartbeat(heartbeat) if autopilot => {
                self.autopilot_heard = true;
                self.armed = heartbeat.armed;
                self.mode = heartbeat.custom_mode;
            }
            Message::Heartbeat(_) => self.pilot_heard = true,
            Message::CommandAck(ack) => self.acknowledged = Some((ack.command, ack.result.to_wire())),
            Message::StatusText { text, .. } => {
                self.texts.push((now, String::from_utf8_lossy(text).into_owned()));
            }
            Message::Tunnel { payload_type: TUNNEL_DECISION, payload, .. } => {
                let record = DecisionRecord::decode(payload);
                if record.is_some_and(|record| record.state == State::Engaged) {
                    self.engaged_at.get_or_insert(now);
                }
            }
            _ => {}
        }
    }

    fn advance(&mut self, now: Instant, frames: &mut Vec<Vec<u8>>) {
        if let Some(next) = self.finished(now) {
            self.step = next;
            self.step_since = now;
            self.ask_at = now;
            self.acknowledged = None;
            self.confirmed = None;
        }
        if self.step == Step::Flying {
            self.confirm_switch(now);
        }
        if now < self.ask_at {
            return;
        }
        self.ask_at = now + REPEAT;
        match self.step {
            Step::Configure(index) => {
                let (name, value) = self.orders.parameters[index];
                frames.push(self.set_parameter(name, value));
            }
            Step::Ready => {
                for &(message_id, interval_us) in stack::streams(self.orders.autopilot) {
                    let ask = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL;
                    frames.push(self.command(1, ask, [message_id, interval_us, 0.0, 0.0]));
                }
            }
            Step::Guided => frames.push(self.command(
                1,
                MavCmd::MAV_CMD_DO_SET_MODE,
                stack::select_guided(self.orders.autopilot),
            )),
            Step::Arm => {
                frames.push(self.command(1, MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0]));
            }
            Step::TakeOff => {
                let Orders { autopilot, altitude_m, .. } = self.orders;
                let altitude_m = stack::take_off_altitude_m(autopilot, altitude_m, self.home_amsl_m);
                frames.push(self.command(1, MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0, 0.0, altitude_m]));
            }
            Step::Engage => {
                let pilot = self.orders.component_id;
                frames.push(self.command(pilot, MavCmd::MAV_CMD_USER_2, [1.0, 0.0, 0.0, 0.0]));
            }
            Step::Offboard => frames.push(self.command(
                1,
                MavCmd::MAV_CMD_DO_SET_MODE,
                stack::select_guided(self.orders.autopilot),
            )),
            Step::Flying => self.switch(now, frames),
            Step::Peers | Step::Climb | Step::Over => {}
        }
    }

    /// The step that follows, when the present one is done.
    fn finished(&self, now: Instant) -> Option<Step> {
        let configure = |index: usize| {
            if index < self.orders.parameters.len() { Step::Configure(index) } else { Step::Ready }
        };
        let accepted = |command: MavCmd| self.acknowledged == Some((command as u32 as u16, 0));
        match self.step {
            Step::Peers => {
                let pilot_needed = self.orders.engage || !self.orders.parameters.is_empty();
                (self.autopilot_heard && (self.pilot_heard || !pilot_needed)).then(|| configure(0))
            }
            Step::Configure(index) => {
                let (name, value) = self.orders.parameters[index];
                let done = self.confirmed.as_ref().is_some_and(|(n, v)| n == name && *v == value);
                done.then(|| configure(index + 1))
            }
            Step::Ready => {
                let autopilot = self.orders.autopilot;
                let trusted = stack::trusted_estimator(autopilot);
                let home = autopilot == AutopilotKind::ArduPilot || self.home_amsl_m.is_some();
                let next = if autopilot == AutopilotKind::ArduPilot { Step::Guided } else { Step::Arm };
                (home && self.estimator & trusted == trusted).then_some(next)
            }
            Step::Guided => (self.mode == stack::guided(self.orders.autopilot)).then_some(Step::Arm),
            Step::Arm => self.armed.then_some(Step::TakeOff),
            Step::TakeOff => accepted(MavCmd::MAV_CMD_NAV_TAKEOFF).then_some(Step::Climb),
            Step::Climb => {
                (self.height_m > self.orders.altitude_m - 1.0).then_some(match self.orders.engage {
                    true => Step::Engage,
                    false => Step::Over,
                })
            }
            Step::Engage => match self.orders.autopilot {
                AutopilotKind::ArduPilot => self.engaged_at.map(|_| Step::Flying),
                AutopilotKind::Px4 => {
                    let asked = accepted(MavCmd::MAV_CMD_USER_2);
                    (asked && now - self.step_since >= STREAM_STARTS).then_some(Step::Offboard)
                }
            },
            Step::Offboard => self.engaged_at.map(|_| Step::Flying),
            Step::Flying => (!self.armed).then_some(Step::Over),
            Step::Over => None,
        }
    }

    /// The next change of the preference, when its time has come.
    fn switch(&mut self, now: Instant, frames: &mut Vec<Vec<u8>>) {
        // Looks at every poll; repeats once a second.
        self.ask_at = now;
        let (Some(engaged_at), Some(&Switch { after, w_data })) =
            (self.engaged_at, self.orders.switches.get(self.switched))
        else {
            return;
        };
        if now < engaged_at + after {
            return;
        }
        self.ask_at = now + REPEAT;
        let pilot = self.orders.component_id;
        frames.push(match self.switches_by_command() {
            true => self.command(pilot, MavCmd::MAV_CMD_USER_1, [w_data, 0.0, 0.0, 0.0]),
            false => self.set_parameter("GLN_W_DATA", w_data),
        });
    }

    /// Counts a change of the preference that the pilot has confirmed.
    fn confirm_switch(&mut self, now: Instant) {
        let Some(&Switch { w_data, .. }) = self.orders.switches.get(self.switched) else { return };
        let confirmed = match self.switches_by_command() {
            true => self.acknowledged == Some((MavCmd::MAV_CMD_USER_1 as u32 as u16, 0)),
            false => {
                self.confirmed.as_ref().is_some_and(|(name, value)| name == "GLN_W_DATA" && *value == w_data)
            }
        };
        if confirmed {
            self.switched += 1;
            self.acknowledged = None;
            self.confirmed = None;
            self.ask_at = now;
        }
    }

    fn switches_by_command(&self) -> bool {
        self.switched.is_multiple_of(2)
    }

    fn set_parameter(&mut self, name: &'static str, value: f32) -> Vec<u8> {
        self.confirmed = None;
        self.speaker.frame(&PARAM_SET_DATA {
            param_value: value,
            target_system: self.orders.system_id,
            target_component: self.orders.component_id,
            param_id: name.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        })
    }

    /// Parameters 1, 2, 3 and 7.
    fn command(
        &mut self,
        component: u8,
        command: MavCmd,
        [param1, param2, param3, param7]: [f32; 4],
    ) -> Vec<u8> {
        self.speaker.frame(&COMMAND_LONG_DATA {
            param1,
            param2,
            param3,
            param7,
            command,
            target_system: self.orders.system_id,
            target_component: component,
            ..COMMAND_LONG_DATA::DEFAULT
        })
    }
}
