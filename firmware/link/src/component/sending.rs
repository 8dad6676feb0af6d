//! Messages that we send.

use super::Component;
use crate::address::Address;
use crate::message::{Command, CommandResult, SystemState, TUNNEL_BYTES};
use crate::setpoint::PositionTarget;
use crate::settings::NotSent;
use crate::telemetry::Telemetry;
use crate::wire::outgoing::Priority;
use crate::wire::packet::Packet;
use gleaner_units::Instant;
use heapless::Vec;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::dialects::ardupilotmega::{MavAutopilot, MavModeFlag, MavProtocolCapability, MavState, MavType};

/// Longest data of a MAVLink FTP answer of ours. The protocol permits 239; this component's frames are shorter.
pub const FILE_DATA_BYTES: usize = 128;

impl Component {
    pub(super) fn poll_heartbeat(&mut self, now: Instant, state: SystemState) {
        if self.heartbeat_at.is_some_and(|at| now.since(at) < Component::HEARTBEAT_PERIOD) {
            return;
        }
        self.heartbeat_at = Some(now);
        let packet = Packet::new(&dialect::HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::empty(),
            system_status: state.into(),
            mavlink_version: 3,
        });
        self.send(Priority::Heartbeat, packet);
    }

    pub(super) fn send_setpoint(&mut self, now: Instant, target: &PositionTarget) -> Result<(), NotSent> {
        let autopilot = self.autopilot.address().filter(|_| self.autopilot.is_connected());
        let packet = target.packet(now, autopilot.ok_or(NotSent::NoAutopilot)?)?;
        self.send(Priority::Setpoint, packet);
        Ok(())
    }

    /// Sends the values of one second.
    pub fn send_telemetry(&mut self, now: Instant, telemetry: &Telemetry) {
        for (name, value) in telemetry.values() {
            if let Some(value) = value {
                self.telemetry(now, name, value);
            }
        }
    }

    /// Sends one number as `NAMED_VALUE_FLOAT`; the name is cut to 10 characters. A value that is not finite is not
    /// sent.
    pub fn telemetry(&mut self, now: Instant, name: &str, value: f32) {
        if value.is_finite() {
            let data =
                dialect::NAMED_VALUE_FLOAT_DATA { time_boot_ms: now.as_boot_ms(), value, name: name.into() };
            self.send(Priority::Bulk, Packet::new(&data));
        }
    }

    /// Broadcasts up to 128 bytes as `TUNNEL`; a longer payload is not sent.
    pub fn tunnel(&mut self, payload_type: u16, payload: &[u8]) {
        let packet = tunnel_packet(Address::ALL, payload_type, payload);
        self.send(Priority::Bulk, packet);
    }

    pub(super) fn send_ack(&mut self, command: &Command, result: CommandResult) {
        // Field by field: the dialect's type cannot hold a command that it does not list.
        let [command_low, command_high] = command.id.to_le_bytes();
        let sender = command.sender;
        let payload =
            [command_low, command_high, result.to_wire(), 0, 0, 0, 0, 0, sender.system, sender.component];
        let id = dialect::COMMAND_ACK_DATA::ID;
        self.send(Priority::Urgent, Packet::from_payload(id, dialect::COMMAND_ACK_DATA::EXTRA_CRC, &payload));
    }

    pub(super) fn send_timesync(&mut self, now: Instant, asker: Address, asked_ns: i64) {
        let now_ns = i64::try_from(now.as_micros()).unwrap_or(i64::MAX).saturating_mul(1_000);
        let mut payload: Vec<u8, 18> = Vec::new();
        // tc1 of 0 would make it a request.
        for bytes in [now_ns.max(1).to_le_bytes(), asked_ns.to_le_bytes()] {
            let _ = payload.extend_from_slice(&bytes);
        }
        let _ = payload.extend_from_slice(&[asker.system, asker.component]);
        let id = dialect::TIMESYNC_DATA::ID;
        self.send(Priority::Bulk, Packet::from_payload(id, dialect::TIMESYNC_DATA::EXTRA_CRC, &payload));
    }

    pub(super) fn send_autopilot_version(&mut self) {
        let version = dialect::AUTOPILOT_VERSION_DATA {
            capabilities: self.capabilities(),
            flight_sw_version: software_version(),
            ..dialect::AUTOPILOT_VERSION_DATA::DEFAULT
        };
        self.send(Priority::Urgent, Packet::new(&version));
    }

    pub(super) fn send_component_information(&mut self, now: Instant) {
        let information = dialect::COMPONENT_INFORMATION_BASIC_DATA {
            capabilities: self.capabilities(),
            time_boot_ms: now.as_boot_ms(),
            vendor_name: "Gleaner".into(),
            model_name: "Gleaner".into(),
            software_version: env!("CARGO_PKG_VERSION").into(),
            ..dialect::COMPONENT_INFORMATION_BASIC_DATA::DEFAULT
        };
        self.send(Priority::Urgent, Packet::new(&information));
    }

    /// `COMPONENT_METADATA`, if the program has named a file.
    pub(super) fn send_component_metadata(&mut self, now: Instant) {
        let Some(metadata) = &self.metadata else { return };
        let data = dialect::COMPONENT_METADATA_DATA {
            time_boot_ms: now.as_boot_ms(),
            file_crc: metadata.crc,
            uri: metadata.uri.as_str().into(),
        };
        self.send(Priority::Urgent, Packet::new(&data));
    }

    /// Answers a MAVLink FTP request of `to`: sequence number, session, opcode, size, opcode of the request, burst flag,
    /// padding and offset, then the data. Longer data than [`FILE_DATA_BYTES`] is not sent.
    pub fn reply_file(&mut self, to: Address, header: [u8; 12], data: &[u8]) {
        let mut payload: Vec<u8, { 15 + FILE_DATA_BYTES }> = Vec::from_array([0, to.system, to.component]);
        if payload.extend_from_slice(&header).is_err() || payload.extend_from_slice(data).is_err() {
            return;
        }
        let id = dialect::FILE_TRANSFER_PROTOCOL_DATA::ID;
        let extra = dialect::FILE_TRANSFER_PROTOCOL_DATA::EXTRA_CRC;
        self.send(Priority::Bulk, Packet::from_payload(id, extra, &payload));
    }

    /// Refuses a MAVLink FTP request at once, so that the ground station does not wait for a timeout.
    pub(super) fn refuse_file_request(&mut self, to: Address, sequence: u16, session: u8, opcode: u8) {
        const NAK: u8 = 129;
        const UNKNOWN_COMMAND: u8 = 7;
        let [low, high] = sequence.wrapping_add(1).to_le_bytes();
        self.reply_file(to, [low, high, session, NAK, 1, opcode, 0, 0, 0, 0, 0, 0], &[UNKNOWN_COMMAND]);
    }

    fn capabilities(&self) -> MavProtocolCapability {
        let files = match self.metadata {
            Some(_) => MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_FTP,
            None => MavProtocolCapability::empty(),
        };
        MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | files
    }

    fn send(&mut self, priority: Priority, packet: Option<Packet>) {
        if let Some(packet) = packet {
            self.outgoing.push(priority, packet);
        }
    }
}

/// `TUNNEL`, field by field: the dialect's type cannot hold a payload type that it does not list.
fn tunnel_packet(target: Address, payload_type: u16, payload: &[u8]) -> Option<Packet> {
    const HEADER: usize = 5;
    let length = u8::try_from(payload.len()).ok().filter(|&length| usize::from(length) <= TUNNEL_BYTES)?;
    let [type_low, type_high] = payload_type.to_le_bytes();
    let mut bytes: Vec<u8, { HEADER + TUNNEL_BYTES }> =
        Vec::from_array([type_low, type_high, target.system, target.component, length]);
    bytes.extend_from_slice(payload).ok()?;
    Packet::from_payload(dialect::TUNNEL_DATA::ID, dialect::TUNNEL_DATA::EXTRA_CRC, &bytes)
}

/// The package's version as major, minor, patch and type 255 (`FIRMWARE_VERSION_TYPE_OFFICIAL`), one byte each.
fn software_version() -> u32 {
    let part = |text: &str| text.parse().unwrap_or(0);
    u32::from_be_bytes([
        part(env!("CARGO_PKG_VERSION_MAJOR")),
        part(env!("CARGO_PKG_VERSION_MINOR")),
        part(env!("CARGO_PKG_VERSION_PATCH")),
        255,
    ])
}

impl From<SystemState> for MavState {
    fn from(state: SystemState) -> MavState {
        match state {
            SystemState::Uninitialised => MavState::MAV_STATE_UNINIT,
            SystemState::Boot => MavState::MAV_STATE_BOOT,
            SystemState::Calibrating => MavState::MAV_STATE_CALIBRATING,
            SystemState::Standby => MavState::MAV_STATE_STANDBY,
            SystemState::Active => MavState::MAV_STATE_ACTIVE,
            SystemState::Critical => MavState::MAV_STATE_CRITICAL,
            SystemState::Emergency => MavState::MAV_STATE_EMERGENCY,
            SystemState::PowerOff => MavState::MAV_STATE_POWEROFF,
            SystemState::FlightTermination => MavState::MAV_STATE_FLIGHT_TERMINATION,
        }
    }
}
