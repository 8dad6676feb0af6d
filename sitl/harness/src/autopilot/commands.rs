//! What others ask of the autopilot.

use super::battery::Level;
use super::guidance::Guidance;
use super::parameters::Parameter;
use super::streams::STREAMABLE;
use super::{Copter, CopterMode, LinkId};
use crate::wire;
use gleaner_link::{Address, Command, Frame, Message, ParameterKey};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::MavResult::{self, *};
use mavlink::dialects::ardupilotmega::{MavCmd, MavSeverity, PARAM_VALUE_DATA, TIMESYNC_DATA};

/// Superseded messages that ground stations still send, so the definitions' own names would be warned of.
const SET_MODE: u32 = 11;
const REQUEST_DATA_STREAM: u32 = 66;

/// `COMPONENT_ARM_DISARM` param2: do it whatever the checks say.
const FORCE: f32 = 21196.0;

impl Copter {
    pub(super) fn handle(&mut self, link: LinkId, frame: &Frame) {
        if !self.route(link, frame) {
            return;
        }
        match frame.message_id {
            dialect::SET_POSITION_TARGET_LOCAL_NED_DATA::ID => match wire::parse(frame) {
                Some(target) => self.take_target(&target),
                // An unknown frame number: the real one stops and holds.
                None if self.mode == CopterMode::Guided => self.guidance = Guidance::Halt,
                None => {}
            },
            SET_MODE => self.set_mode(link, frame),
            REQUEST_DATA_STREAM => self.set_all_streams(link, frame),
            _ => {
                if let Ok(Some(message)) = Message::decode(frame) {
                    self.handle_message(link, frame.sender, &message);
                }
            }
        }
    }

    fn handle_message(&mut self, link: LinkId, sender: Address, message: &Message) {
        match message {
            Message::Command(command) => {
                let result = self.obey(link, command);
                self.acknowledge(link, command.id, result, sender);
            }
            Message::ParameterList { .. } => {
                for index in 0..self.parameters.len() {
                    self.send_parameter(&[link], index);
                }
            }
            Message::ParameterRead { key, .. } => {
                let index = match key {
                    ParameterKey::Index(index) => Some(usize::from(*index)),
                    ParameterKey::Name(name) => self.parameters.index(name),
                };
                if let Some(index) = index {
                    self.send_parameter(&[link], index);
                }
            }
            Message::ParameterSet { name, value, .. } => {
                if let Some(index) = self.parameters.set(name, *value) {
                    self.send_parameter(&LinkId::ALL, index);
                }
            }
            Message::TimesyncRequest { asked_ns, .. } => {
                let answer = TIMESYNC_DATA {
                    tc1: self.now.as_micros() as i64 * 1000,
                    ts1: *asked_ns,
                    target_system: sender.system,
                    target_component: sender.component,
                };
                self.send(link, &answer);
            }
            _ => {}
        }
    }

    fn obey(&mut self, link: LinkId, command: &Command) -> MavResult {
        let [p1, p2, _, _, _, _, p7] = command.params;
        let Some(name) = command_name(command.id) else { return MAV_RESULT_UNSUPPORTED };
        match name {
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM if p1 == 1.0 => self.arm(p2 == FORCE),
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.disarm_on_request(p2 == FORCE),
            MavCmd::MAV_CMD_DO_SET_MODE => self.change_mode(link, p2 as u32),
            MavCmd::MAV_CMD_NAV_TAKEOFF => self.take_off(p7),
            MavCmd::MAV_CMD_NAV_LAND => self.change_mode(link, CopterMode::Land.number()),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => self.change_mode(link, CopterMode::Rtl.number()),
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => self.change_speed(p1, p2),
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
                let now = self.now;
                let known = self.link_mut(link).streams.set(now, p1 as u32, p2);
                if known { MAV_RESULT_ACCEPTED } else { MAV_RESULT_DENIED }
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE => {
                let sent = self.send_by_id(link, p1 as u32);
                if sent { MAV_RESULT_ACCEPTED } else { MAV_RESULT_FAILED }
            }
            _ => MAV_RESULT_UNSUPPORTED,
        }
    }

    fn arm(&mut self, force: bool) -> MavResult {
        if self.armed {
            return MAV_RESULT_ACCEPTED;
        }
        let reason = if !self.estimator_ready() {
            Some("Need Position Estimate".to_owned())
        } else if !self.mode.allows_arming() {
            Some(format!("{} mode not armable", self.mode.name()))
        } else if self.battery.level() > Level::Fine {
            Some("Battery 1 low voltage failsafe".to_owned())
        } else {
            None
        };
        if let Some(reason) = reason.filter(|_| !force) {
            self.say(MavSeverity::MAV_SEVERITY_CRITICAL, &format!("Arm: {reason}"));
            return MAV_RESULT_FAILED;
        }
        self.armed = true;
        self.armed_at = self.now;
        self.guidance = Guidance::Halt;
        // Home is where the motors were started.
        self.home = Some(self.estimated());
        self.say(MavSeverity::MAV_SEVERITY_INFO, "Arming motors");
        self.announce_origin_and_home();
        MAV_RESULT_ACCEPTED
    }

    fn disarm_on_request(&mut self, force: bool) -> MavResult {
        if self.armed && !self.on_ground && !force {
            return MAV_RESULT_FAILED;
        }
        if self.armed {
            self.disarm();
        }
        MAV_RESULT_ACCEPTED
    }

    fn change_mode(&mut self, link: LinkId, custom_mode: u32) -> MavResult {
        match CopterMode::from_number(custom_mode) {
            None => {
                self.say(MavSeverity::MAV_SEVERITY_WARNING, &format!("No such mode {custom_mode}"));
                MAV_RESULT_FAILED
            }
            Some(mode) if mode.needs_position() && !self.estimator_ready() => {
                let text = format!("Mode change to {} failed: requires position", mode.name());
                self.say(MavSeverity::MAV_SEVERITY_WARNING, &text);
                MAV_RESULT_FAILED
            }
            Some(mode) => {
                self.enter(mode, link == LinkId::COMPANION);
                MAV_RESULT_ACCEPTED
            }
        }
    }

    /// The old message that many ground stations still use for the same.
    fn set_mode(&mut self, link: LinkId, frame: &Frame) {
        let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
        let custom_mode = u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]);
        let result = self.change_mode(link, custom_mode);
        self.acknowledge(link, SET_MODE as u16, result, frame.sender);
    }

    fn take_off(&mut self, height_m: f32) -> MavResult {
        let possible = self.mode == CopterMode::Guided && self.armed && self.on_ground;
        let (Some(home), true, true) = (self.home, possible, height_m > 0.0) else {
            return MAV_RESULT_FAILED;
        };
        let [north, east, _] = self.body.position;
        let point = [north, east, f64::from(home.down_m) - f64::from(height_m)];
        self.guidance = Guidance::TakeOff { point, since: self.now };
        MAV_RESULT_ACCEPTED
    }

    /// Kinds 0 and 1 are the same to a multicopter; it acts at once, in mid-flight.
    fn change_speed(&mut self, kind: f32, speed_mps: f32) -> MavResult {
        if (kind == 0.0 || kind == 1.0) && speed_mps > 0.0 && speed_mps.is_finite() {
            self.cruise_mps = speed_mps.into();
            MAV_RESULT_ACCEPTED
        } else {
            MAV_RESULT_DENIED
        }
    }

    /// `REQUEST_DATA_STREAM`, the way of older ground stations; every stream number asks for all of them here.
    fn set_all_streams(&mut self, link: LinkId, frame: &Frame) {
        let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
        let (rate_hz, start) = (u16::from_le_bytes([byte(0), byte(1)]), byte(5) == 1);
        let interval_us = if start && rate_hz > 0 { 1e6 / f32::from(rate_hz) } else { -1.0 };
        let now = self.now;
        for message_id in STREAMABLE {
            self.link_mut(link).streams.set(now, message_id, interval_us);
        }
    }

    fn send_parameter(&mut self, links: &[LinkId], index: usize) {
        let count = self.parameters.len() as u16;
        let Some(&Parameter { name, value, kind }) = self.parameters.at(index) else { return };
        let data = PARAM_VALUE_DATA {
            param_id: name.into(),
            param_value: value,
            param_type: kind,
            param_count: count,
            param_index: index as u16,
        };
        for &link in links {
            self.send(link, &data);
        }
    }

    /// `COMMAND_ACK` by hand: command numbers that the definitions do not list are answered too.
    fn acknowledge(&mut self, link: LinkId, command: u16, result: MavResult, to: Address) {
        let [low, high] = command.to_le_bytes();
        let payload = [low, high, result as u8, 0, 0, 0, 0, 0, to.system, to.component];
        let link = self.link_mut(link);
        let frame = link.speaker.raw_frame(dialect::COMMAND_ACK_DATA::ID, &payload);
        link.out.push(frame);
    }
}

/// The command with this number, if it is one of those that are simulated.
fn command_name(id: u16) -> Option<MavCmd> {
    const KNOWN: [MavCmd; 8] = [
        MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        MavCmd::MAV_CMD_DO_SET_MODE,
        MavCmd::MAV_CMD_NAV_TAKEOFF,
        MavCmd::MAV_CMD_NAV_LAND,
        MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH,
        MavCmd::MAV_CMD_DO_CHANGE_SPEED,
        MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
        MavCmd::MAV_CMD_REQUEST_MESSAGE,
    ];
    KNOWN.into_iter().find(|&known| known as u32 == u32::from(id))
}
