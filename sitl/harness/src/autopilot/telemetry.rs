//! When the autopilot sends, and the messages that both flight stacks send.

use super::LinkId;
use super::stack::FlightStack;
use gleaner_units::Duration;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);

/// Sends what is due. Nothing leaves while the autopilot boots.
pub(super) fn send_due<S: FlightStack>(stack: &mut S) {
    let vehicle = stack.vehicle_mut();
    if vehicle.now < vehicle.up_from {
        return;
    }
    if vehicle.now >= vehicle.next_heartbeat {
        vehicle.next_heartbeat = vehicle.next_heartbeat + HEARTBEAT_INTERVAL;
        send_heartbeats(stack);
    }
    for link in LinkId::ALL {
        while let Some(message_id) = next_due(stack, link) {
            send_by_id(stack, link, message_id);
        }
    }
}

fn next_due<S: FlightStack>(stack: &mut S, link: LinkId) -> Option<u32> {
    let vehicle = stack.vehicle_mut();
    vehicle.ports.due(link, vehicle.now)
}

/// On every link.
pub(super) fn send_heartbeats<S: FlightStack>(stack: &mut S) {
    let data = stack.heartbeat();
    for link in LinkId::ALL {
        stack.vehicle_mut().ports.send(link, &data);
    }
}

/// Sends one message of this kind; whether there is one. Without an origin there is no position.
pub(super) fn send_by_id<S: FlightStack>(stack: &mut S, link: LinkId, message_id: u32) -> bool {
    let now = stack.vehicle().now;
    match message_id {
        AUTOPILOT_VERSION_DATA::ID => send(stack, link, &version::<S>()),
        SYS_STATUS_DATA::ID => send(stack, link, &stack.sys_status()),
        SYSTEM_TIME_DATA::ID => {
            send(stack, link, &SYSTEM_TIME_DATA { time_boot_ms: now.as_boot_ms(), time_unix_usec: 0 });
        }
        GPS_RAW_INT_DATA::ID => send(stack, link, &stack.vehicle().airframe.gps_message(now)),
        ATTITUDE_DATA::ID => send(stack, link, &stack.vehicle().airframe.attitude_message(now)),
        VFR_HUD_DATA::ID => send(stack, link, &stack.vehicle().airframe.hud_message()),
        BATTERY_STATUS_DATA::ID => send(stack, link, &stack.battery_status()),
        EXTENDED_SYS_STATE_DATA::ID => send(stack, link, &stack.landed()),
        RC_CHANNELS_DATA::ID => send(stack, link, &stack.rc()),
        _ if stack.send_own(link, message_id) => {}
        _ => {
            let vehicle = stack.vehicle_mut();
            let guidance = vehicle.guidance;
            return vehicle.airframe.send_position(&mut vehicle.ports, link, now, guidance, message_id);
        }
    }
    true
}

fn send<S: FlightStack, D: MessageData>(stack: &mut S, link: LinkId, data: &D) {
    stack.vehicle_mut().ports.send(link, data);
}

fn version<S: FlightStack>() -> AUTOPILOT_VERSION_DATA {
    AUTOPILOT_VERSION_DATA {
        capabilities: S::CAPABILITIES,
        flight_sw_version: S::VERSION,
        ..AUTOPILOT_VERSION_DATA::DEFAULT
    }
}
