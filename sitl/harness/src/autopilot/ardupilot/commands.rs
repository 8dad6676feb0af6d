//! Commands and requests that the autopilot receives.

use super::super::battery::Level;
use super::super::guidance::Guidance;
use super::super::parameters::Parameter;
use super::super::{AutopilotKind, Commander, LinkId, VehicleMode};
use super::ArduCopter;
use crate::wire;
use gleaner_link::{Address, Command, Frame, Message, ParameterKey};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::MavResult::{self, *};
use mavlink::dialects::ardupilotmega::{
    MavCmd, MavSeverity, PARAM_VALUE_DATA, SET_POSITION_TARGET_LOCAL_NED_DATA, TIMESYNC_DATA,
};

/// Superseded messages that ground stations still send; the generated names carry deprecation warnings.
const SET_MODE: u32 = 11;
const REQUEST_DATA_STREAM: u32 = 66;

/// `COMPONENT_ARM_DISARM` param2: skip the checks.
const FORCE: f32 = 21196.0;

impl ArduCopter {
    pub(super) fn handle(&mut self, link: LinkId, frame: &Frame) {
        if !self.ports.route(link, frame) {
            return;
        }
        match frame.message_id {
            SET_POSITION_TARGET_LOCAL_NED_DATA::ID => match wire::parse(frame) {
                Some(target) => self.take_target(&target, link.commander()),
                // An unknown frame number: it stops and holds.
                None if self.mode == VehicleMode::Guided => self.guidance = Guidance::Halt,
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
            Message::ParameterSet { name, value, .. } => {
                if let Some(index) = self.set_own_parameter(name, *value) {
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
                self.ports.send(link, &answer);
            }
            _ => {}
        }
    }

    fn obey(&mut self, link: LinkId, command: &Command) -> MavResult {
        let [p1, p2, _, _, _, _, p7] = command.params;
        let by = link.commander();
        let is = |known: MavCmd| known as u32 == u32::from(command.id);
        match () {
            () if is(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM) && p1 == 1.0 => self.arm(p2 == FORCE),
            () if is(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM) => self.disarm_on_request(p2 == FORCE),
            () if is(MavCmd::MAV_CMD_DO_SET_MODE) => self.change_mode(by, p2 as u32),
            () if is(MavCmd::MAV_CMD_NAV_TAKEOFF) => self.take_off(p7),
            () if is(MavCmd::MAV_CMD_NAV_LAND) => self.request_mode(by, VehicleMode::Land),
            () if is(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH) => self.request_mode(by, VehicleMode::Return),
            () if is(MavCmd::MAV_CMD_DO_CHANGE_SPEED) => self.change_speed(p1, p2),
            () if is(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL) => {
                let known = self.ports.streams(link).set(self.now, p1 as u32, p2);
                if known { MAV_RESULT_ACCEPTED } else { MAV_RESULT_DENIED }
            }
            () if is(MavCmd::MAV_CMD_REQUEST_MESSAGE) => {
                let sent = self.send_by_id(link, p1 as u32);
                if sent { MAV_RESULT_ACCEPTED } else { MAV_RESULT_FAILED }
            }
            () => MAV_RESULT_UNSUPPORTED,
        }
    }

    fn arm(&mut self, force: bool) -> MavResult {
        if self.armed {
            return MAV_RESULT_ACCEPTED;
        }
        let armable = !matches!(self.mode, VehicleMode::Return | VehicleMode::Land | VehicleMode::Brake);
        let reason = if !self.airframe.estimator_ready(self.now) {
            Some("Need Position Estimate".to_owned())
        } else if !armable {
            Some(format!("{} mode not armable", name(self.mode)))
        } else if self.airframe.battery.level > Level::Fine {
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
        // Home is where the motors are armed.
        self.airframe.home = Some(self.airframe.estimated());
        self.say(MavSeverity::MAV_SEVERITY_INFO, "Arming motors");
        self.announce_origin_and_home();
        MAV_RESULT_ACCEPTED
    }

    fn disarm_on_request(&mut self, force: bool) -> MavResult {
        if self.armed && !self.airframe.on_ground && !force {
            return MAV_RESULT_FAILED;
        }
        if self.armed {
            self.disarm();
        }
        MAV_RESULT_ACCEPTED
    }

    fn change_mode(&mut self, by: Commander, custom_mode: u32) -> MavResult {
        match VehicleMode::from_custom_mode(AutopilotKind::ArduPilot, custom_mode) {
            None => {
                self.say(MavSeverity::MAV_SEVERITY_WARNING, &format!("No such mode {custom_mode}"));
                MAV_RESULT_FAILED
            }
            Some(mode) => self.request_mode(by, mode),
        }
    }

    fn request_mode(&mut self, by: Commander, mode: VehicleMode) -> MavResult {
        if mode.needs_position() && !self.airframe.estimator_ready(self.now) {
            let text = format!("Mode change to {} failed: requires position", name(mode));
            self.say(MavSeverity::MAV_SEVERITY_WARNING, &text);
            return MAV_RESULT_FAILED;
        }
        self.enter(mode, by);
        MAV_RESULT_ACCEPTED
    }

    /// The older message with the same meaning as `DO_SET_MODE`.
    fn set_mode(&mut self, link: LinkId, frame: &Frame) {
        let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
        let custom_mode = u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]);
        let result = self.change_mode(link.commander(), custom_mode);
        self.ports.acknowledge(link, SET_MODE as u16, result, frame.sender);
    }

    fn take_off(&mut self, height_m: f32) -> MavResult {
        let possible = self.mode == VehicleMode::Guided && self.armed && self.airframe.on_ground;
        if self.airframe.home.is_none() || !possible || height_m.is_nan() || height_m <= 0.0 {
            return MAV_RESULT_FAILED;
        }
        let [north, east, _] = self.airframe.body.position;
        let point = [north, east, self.airframe.home_in_boot_frame()[2] - f64::from(height_m)];
        self.guidance = Guidance::TakeOff { point, since: self.now };
        MAV_RESULT_ACCEPTED
    }

    /// Kinds 0 and 1 are the same to a multicopter. It takes effect at once, also during a leg.
    fn change_speed(&mut self, kind: f32, speed_mps: f32) -> MavResult {
        if (kind == 0.0 || kind == 1.0) && speed_mps > 0.0 && speed_mps.is_finite() {
            self.cruise_mps = speed_mps.into();
            MAV_RESULT_ACCEPTED
        } else {
            MAV_RESULT_DENIED
        }
    }

    /// `REQUEST_DATA_STREAM` of older ground stations; every stream number requests all messages here.
    fn set_all_streams(&mut self, link: LinkId, frame: &Frame) {
        let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
        let (rate_hz, start) = (u16::from_le_bytes([byte(0), byte(1)]), byte(5) == 1);
        let interval_us = if start && rate_hz > 0 { 1e6 / f32::from(rate_hz) } else { -1.0 };
        self.ports.streams(link).set_all(self.now, interval_us);
    }

    /// ArduPilot sends integers by C cast: the float field holds the number.
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
            self.ports.send(link, &data);
        }
    }
}

/// As ArduPilot spells the mode in its texts.
const fn name(mode: VehicleMode) -> &'static str {
    match mode {
        VehicleMode::Stabilize => "Stabilize",
        VehicleMode::AltitudeHold => "AltHold",
        VehicleMode::Guided | VehicleMode::TakeOff => "Guided",
        VehicleMode::Hold => "Loiter",
        VehicleMode::Return => "RTL",
        VehicleMode::Land => "Land",
        VehicleMode::Brake => "Brake",
    }
}
