//! Commands and parameter messages that both flight stacks obey alike.

use super::guidance::Guidance;
use super::parameters::Parameter;
use super::stack::FlightStack;
use super::{LinkId, VehicleMode, telemetry};
use gleaner_link::{Address, Command, Frame, Message, ParameterKey};
use mavlink::dialects::ardupilotmega::MavResult::{self, *};
use mavlink::dialects::ardupilotmega::{MavCmd, MavSeverity, PARAM_VALUE_DATA, TIMESYNC_DATA};

/// `COMPONENT_ARM_DISARM` param2: skip the checks.
const FORCE: f32 = 21196.0;

/// Routes a frame, and handles it if it is addressed to the autopilot.
pub(super) fn handle<S: FlightStack>(stack: &mut S, link: LinkId, frame: &Frame) {
    if !stack.vehicle_mut().ports.route(link, frame) || stack.handle(link, frame) {
        return;
    }
    if let Ok(Some(message)) = Message::decode(frame) {
        handle_message(stack, link, frame.sender, &message);
    }
}

fn handle_message<S: FlightStack>(stack: &mut S, link: LinkId, sender: Address, message: &Message) {
    match message {
        Message::Command(command) => {
            let result = obey(stack, link, command);
            stack.vehicle_mut().ports.acknowledge(link, command.id, result, sender);
        }
        Message::ParameterList { .. } => {
            for index in 0..stack.vehicle().parameters.len() {
                send_parameter(stack, &[link], index);
            }
        }
        Message::ParameterRead { key, .. } => {
            let index = match key {
                ParameterKey::Index(index) => Some(usize::from(*index)),
                ParameterKey::Name(name) => stack.vehicle().parameters.index(name),
            };
            if let Some(index) = index {
                send_parameter(stack, &[link], index);
            }
        }
        Message::ParameterSet { name, value, .. } => {
            if let Some(index) = set_parameter(stack, name, *value) {
                send_parameter(stack, &LinkId::ALL, index);
            }
        }
        Message::TimesyncRequest { asked_ns, .. } => {
            let vehicle = stack.vehicle_mut();
            let answer = TIMESYNC_DATA {
                tc1: vehicle.now.as_micros() as i64 * 1000,
                ts1: *asked_ns,
                target_system: sender.system,
                target_component: sender.component,
            };
            vehicle.ports.send(link, &answer);
        }
        _ => {}
    }
}

fn obey<S: FlightStack>(stack: &mut S, link: LinkId, command: &Command) -> MavResult {
    let [p1, p2, p3, _, _, _, p7] = command.params;
    let by = link.commander();
    let is = |known: MavCmd| known as u32 == u32::from(command.id);
    match () {
        () if is(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM) && p1 == 1.0 => arm(stack, p2 == FORCE),
        () if is(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM) => disarm_on_request(stack, p2 == FORCE),
        () if is(MavCmd::MAV_CMD_DO_SET_MODE) => stack.set_mode(by, p2, p3),
        () if is(MavCmd::MAV_CMD_NAV_TAKEOFF) => stack.take_off(by, p7),
        () if is(MavCmd::MAV_CMD_NAV_LAND) => stack.request_mode(by, VehicleMode::Land),
        () if is(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH) => stack.request_mode(by, VehicleMode::Return),
        () if is(MavCmd::MAV_CMD_DO_CHANGE_SPEED) => stack.change_speed(p1, p2),
        () if is(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL) => {
            if stack.set_interval(link, p1 as u32, p2) {
                MAV_RESULT_ACCEPTED
            } else {
                MAV_RESULT_DENIED
            }
        }
        () if is(MavCmd::MAV_CMD_REQUEST_MESSAGE) => {
            let sent = telemetry::send_by_id(stack, link, p1 as u32);
            if sent { MAV_RESULT_ACCEPTED } else { S::NO_MESSAGE }
        }
        () => MAV_RESULT_UNSUPPORTED,
    }
}

fn arm<S: FlightStack>(stack: &mut S, force: bool) -> MavResult {
    if stack.vehicle().armed {
        return MAV_RESULT_ACCEPTED;
    }
    if let Some(reason) = stack.arming_refusal().filter(|_| !force) {
        stack.say(MavSeverity::MAV_SEVERITY_CRITICAL, &reason);
        return S::REFUSED;
    }
    let vehicle = stack.vehicle_mut();
    vehicle.armed = true;
    vehicle.armed_at = vehicle.now;
    vehicle.guidance = Guidance::Halt;
    // Home is where the motors are armed.
    vehicle.airframe.home = Some(vehicle.airframe.estimated());
    stack.armed();
    MAV_RESULT_ACCEPTED
}

fn disarm_on_request<S: FlightStack>(stack: &mut S, force: bool) -> MavResult {
    let vehicle = stack.vehicle();
    if vehicle.armed && !vehicle.airframe.on_ground && !force {
        return S::REFUSED;
    }
    if vehicle.armed {
        disarm(stack);
    }
    MAV_RESULT_ACCEPTED
}

/// Stops the motors. The mode stays as it is.
pub(super) fn disarm<S: FlightStack>(stack: &mut S) {
    let vehicle = stack.vehicle_mut();
    vehicle.armed = false;
    vehicle.guidance = Guidance::Halt;
    stack.disarmed();
    stack.say(MavSeverity::MAV_SEVERITY_INFO, S::DISARMED);
}

/// Sets one of the autopilot's own parameters: its index, `None` for an unknown name.
pub(super) fn set_parameter<S: FlightStack>(stack: &mut S, name: &str, value: f32) -> Option<usize> {
    let index = stack.vehicle_mut().parameters.set(name, value)?;
    stack.read_parameters();
    Some(index)
}

/// `PARAM_VALUE` on these links.
pub(super) fn send_parameter<S: FlightStack>(stack: &mut S, links: &[LinkId], index: usize) {
    let vehicle = stack.vehicle_mut();
    let Some(parameter @ &Parameter { name, kind, .. }) = vehicle.parameters.at(index) else { return };
    let data = PARAM_VALUE_DATA {
        param_id: name.into(),
        param_value: S::on_wire(parameter),
        param_type: kind,
        param_count: vehicle.parameters.len() as u16,
        param_index: index as u16,
    };
    for &link in links {
        vehicle.ports.send(link, &data);
    }
}
