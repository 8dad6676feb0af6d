//! Commands and requests that the autopilot receives.

use super::super::battery::Level;
use super::super::guidance::Guidance;
use super::super::messages::ORIGIN_AMSL_MM;
use super::super::parameters::Parameter;
use super::super::{AutopilotKind, Commander, LinkId, VehicleMode};
use super::Px4;
use crate::wire;
use gleaner_link::{Address, Command, Frame, Message, ParameterKey};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::MavResult::{self, *};
use mavlink::dialects::ardupilotmega::{
    MavCmd, MavParamType, MavSeverity, PARAM_SET_DATA, PARAM_VALUE_DATA, SET_POSITION_TARGET_LOCAL_NED_DATA,
    TIMESYNC_DATA,
};

/// `COMPONENT_ARM_DISARM` param2: skip the checks.
const FORCE: f32 = 21196.0;

impl Px4 {
    pub(super) fn handle(&mut self, link: LinkId, frame: &Frame) {
        if !self.ports.route(link, frame) {
            return;
        }
        match frame.message_id {
            SET_POSITION_TARGET_LOCAL_NED_DATA::ID => {
                if let Some(target) = wire::parse(frame) {
                    self.take_target(&target, link.commander());
                }
            }
            PARAM_SET_DATA::ID => {
                if let Some(set) = wire::parse::<PARAM_SET_DATA>(frame) {
                    self.set_parameter_from_wire(&set);
                }
            }
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
                self.ports.acknowledge(link, command.id, result, sender);
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
            Message::TimesyncRequest { asked_ns, .. } => {
                let answer = TIMESYNC_DATA {
                    tc1: self.now.as_micros() as i64 * 1000,
                    ts1: *asked_ns,
                    target_system: sender.system,
                    target_component: sender.component,
                };
                self.ports.send(link, &answer);
            }
            _ => {}
        }
    }

    fn obey(&mut self, link: LinkId, command: &Command) -> MavResult {
        let [p1, p2, p3, _, _, _, p7] = command.params;
        let by = link.commander();
        let is = |known: MavCmd| known as u32 == u32::from(command.id);
        match () {
            () if is(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM) && p1 == 1.0 => self.arm(p2 == FORCE),
            () if is(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM) => self.disarm_on_request(p2 == FORCE),
            () if is(MavCmd::MAV_CMD_DO_SET_MODE) => {
                // Main mode in param2, sub mode in param3.
                let custom_mode = (p2 as u32) << 16 | (p3 as u32) << 24;
                match VehicleMode::from_custom_mode(AutopilotKind::Px4, custom_mode) {
                    Some(mode) => self.request_mode(by, mode),
                    None => MAV_RESULT_DENIED,
                }
            }
            () if is(MavCmd::MAV_CMD_NAV_TAKEOFF) => self.take_off(by, p7),
            () if is(MavCmd::MAV_CMD_NAV_LAND) => self.request_mode(by, VehicleMode::Land),
            () if is(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH) => self.request_mode(by, VehicleMode::Return),
            // Accepted, without effect in OFFBOARD.
            () if is(MavCmd::MAV_CMD_DO_CHANGE_SPEED) => MAV_RESULT_ACCEPTED,
            () if is(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL) => {
                let known = self.set_interval(link, p1 as u32, p2);
                if known { MAV_RESULT_ACCEPTED } else { MAV_RESULT_DENIED }
            }
            () if is(MavCmd::MAV_CMD_REQUEST_MESSAGE) => {
                let sent = self.send_by_id(link, p1 as u32);
                if sent { MAV_RESULT_ACCEPTED } else { MAV_RESULT_DENIED }
            }
            () => MAV_RESULT_UNSUPPORTED,
        }
    }

    fn arm(&mut self, force: bool) -> MavResult {
        if self.armed {
            return MAV_RESULT_ACCEPTED;
        }
        let reason = if !self.airframe.estimator_ready(self.now) {
            Some("Arming denied: global position required")
        } else if self.mode == VehicleMode::Guided && !self.has_stream() {
            Some("Arming denied: no offboard signal")
        } else if matches!(self.mode, VehicleMode::Return | VehicleMode::Land) {
            Some("Arming denied: switch to another mode first")
        } else if self.airframe.battery.level > Level::Low {
            Some("Arming denied: low battery")
        } else {
            None
        };
        if let Some(reason) = reason.filter(|_| !force) {
            self.say(MavSeverity::MAV_SEVERITY_CRITICAL, reason);
            return MAV_RESULT_TEMPORARILY_REJECTED;
        }
        self.armed = true;
        self.armed_at = self.now;
        self.guidance = Guidance::Halt;
        // Home is where the motors are armed.
        self.airframe.home = Some(self.airframe.estimated());
        MAV_RESULT_ACCEPTED
    }

    fn disarm_on_request(&mut self, force: bool) -> MavResult {
        if self.armed && !self.airframe.on_ground && !force {
            return MAV_RESULT_TEMPORARILY_REJECTED;
        }
        if self.armed {
            self.disarm();
        }
        MAV_RESULT_ACCEPTED
    }

    fn request_mode(&mut self, by: Commander, mode: VehicleMode) -> MavResult {
        let ready = self.airframe.estimator_ready(self.now);
        let missing_stream = mode == VehicleMode::Guided && self.armed && !self.has_stream();
        if missing_stream || (mode.needs_position() && !ready) {
            return MAV_RESULT_TEMPORARILY_REJECTED;
        }
        self.enter(mode, by);
        MAV_RESULT_ACCEPTED
    }

    /// The altitude is above mean sea level; NaN is the default height of 2.5 m.
    fn take_off(&mut self, by: Commander, altitude_amsl_m: f32) -> MavResult {
        if self.airframe.home.is_none() || !self.airframe.estimator_ready(self.now) {
            return MAV_RESULT_TEMPORARILY_REJECTED;
        }
        let [north, east, down] = self.airframe.body.position;
        let asked = f64::from(ORIGIN_AMSL_MM) * 1e-3 - f64::from(altitude_amsl_m);
        let target = if altitude_amsl_m.is_finite() { asked } else { down - 2.5 };
        self.enter(VehicleMode::TakeOff, by);
        // A target below the ground: it stays there, in TAKEOFF, as a wrong altitude does on the real one.
        self.guidance = Guidance::TakeOff { point: [north, east, target.min(down)], since: self.now };
        MAV_RESULT_ACCEPTED
    }

    /// Integers arrive as the raw bits of an int32 in the float field.
    fn set_parameter_from_wire(&mut self, set: &PARAM_SET_DATA) {
        let name = set.param_id.to_str().unwrap_or_default();
        let integer = set.param_type == MavParamType::MAV_PARAM_TYPE_INT32;
        let value = if integer { set.param_value.to_bits().cast_signed() as f32 } else { set.param_value };
        let Some(index) = self.parameters.index(name) else { return };
        // A type that is not the parameter's is refused: the old value is sent.
        if self.parameters.at(index).is_some_and(|parameter| parameter.kind == set.param_type) {
            self.set_own_parameter(name, value);
        }
        self.send_parameter(&LinkId::ALL, index);
    }

    fn send_parameter(&mut self, links: &[LinkId], index: usize) {
        let count = self.parameters.len() as u16;
        let Some(&Parameter { name, value, kind }) = self.parameters.at(index) else { return };
        let integer = kind == MavParamType::MAV_PARAM_TYPE_INT32;
        let data = PARAM_VALUE_DATA {
            param_id: name.into(),
            param_value: if integer { f32::from_bits((value as i32).cast_unsigned()) } else { value },
            param_type: kind,
            param_count: count,
            param_index: index as u16,
        };
        for &link in links {
            self.ports.send(link, &data);
        }
    }
}
