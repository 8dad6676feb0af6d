//! Messages: the content of frames, in our units.

mod command;
mod parameter;
mod vehicle;

pub use command::{Command, CommandAck, CommandForm, CommandResult};
pub use parameter::{ParameterKey, ParameterName};
pub use vehicle::{
    BatteryStatus, ChargeState, FollowedTarget, GlobalOrigin, GlobalPosition, Heartbeat, HomePosition,
    LandedState, LocalPosition, RcChannels, SysStatus, SystemState, Velocity,
};

use crate::address::Address;
use crate::fields::Fields;
use crate::wire::frame::Frame;
use heapless::Vec;
use mavlink::dialects::ardupilotmega as dialect;
use mavlink::{MavlinkVersion, MessageData};

/// Payload bytes of a `TUNNEL`, at most.
pub(crate) const TUNNEL_BYTES: usize = 128;

/// Payload of a `TUNNEL` message.
pub type TunnelPayload = Vec<u8, TUNNEL_BYTES>;

/// Severity of a `STATUSTEXT`, in the order of RFC 5424.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
#[expect(missing_docs, reason = "the names are RFC 5424's")]
pub enum Severity {
    Emergency = 0,
    Alert = 1,
    Critical = 2,
    Error = 3,
    Warning = 4,
    Notice = 5,
    Info = 6,
    Debug = 7,
}

/// One message that this component understands.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// `HEARTBEAT`.
    Heartbeat(Heartbeat),
    /// `SYS_STATUS`.
    SysStatus(SysStatus),
    /// `BATTERY_STATUS`.
    BatteryStatus(BatteryStatus),
    /// `LOCAL_POSITION_NED`.
    LocalPosition(LocalPosition),
    /// `POSITION_TARGET_LOCAL_NED`, `POSITION_TARGET_GLOBAL_INT`.
    FollowedTarget(FollowedTarget),
    /// `GLOBAL_POSITION_INT`.
    GlobalPosition(GlobalPosition),
    /// `HOME_POSITION`.
    HomePosition(HomePosition),
    /// `GPS_GLOBAL_ORIGIN`.
    GlobalOrigin(GlobalOrigin),
    /// `EKF_STATUS_REPORT` flags (ArduPilot).
    EkfStatus(u16),
    /// `ESTIMATOR_STATUS` flags (PX4).
    EstimatorStatus(u16),
    /// `EXTENDED_SYS_STATE`.
    LandedState(LandedState),
    /// `RC_CHANNELS`.
    RcChannels(RcChannels),
    /// `COMMAND_LONG` or `COMMAND_INT`.
    Command(Command),
    /// `COMMAND_ACK`.
    CommandAck(CommandAck),
    /// `PARAM_REQUEST_LIST`.
    ParameterList {
        /// Receiver.
        target: Address,
    },
    /// `PARAM_REQUEST_READ`.
    ParameterRead {
        /// Receiver.
        target: Address,
        /// Name or index of the parameter.
        key: ParameterKey,
    },
    /// `PARAM_SET`; the value is as sent, NaN included.
    ParameterSet {
        /// Receiver.
        target: Address,
        /// Name of the parameter.
        name: ParameterName,
        /// The value as sent.
        value: f32,
        /// `MAV_PARAM_TYPE`, which decides how `value` is to be read.
        kind: u8,
    },
    /// `STATUSTEXT`: the severity, and the text of this chunk up to its first NUL (not always UTF-8).
    StatusText {
        /// 0 emergency .. 7 debug.
        severity: u8,
        /// The chunk's bytes.
        text: Vec<u8, 50>,
    },
    /// `TIMESYNC` request.
    TimesyncRequest {
        /// Receiver.
        target: Address,
        /// The sender's clock, ns, to be echoed.
        asked_ns: i64,
    },
    /// `TUNNEL`.
    Tunnel {
        /// Receiver.
        target: Address,
        /// Type of the payload.
        payload_type: u16,
        /// The payload.
        payload: TunnelPayload,
    },
    /// `FILE_TRANSFER_PROTOCOL` request.
    FileRequest {
        /// Receiver.
        target: Address,
        /// Sequence number of the request.
        sequence: u16,
        /// Session of the request.
        session: u8,
        /// Operation asked for.
        opcode: u8,
    },
}

/// Why a frame with a good checksum was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageFault {
    /// A field holds a value that the message does not allow.
    Malformed,
    /// A coordinate or velocity is NaN or infinite.
    NotFinite,
    /// A latitude or longitude that does not exist.
    NotOnTheGlobe,
}

fn parse<D: MessageData>(frame: &Frame) -> Result<D, MessageFault> {
    // Zero extension makes MAVLink 1 frames the same case as truncated ones.
    D::deser(MavlinkVersion::V2, frame.payload()).map_err(|_| MessageFault::Malformed)
}

impl Message {
    /// Reads a frame; `Ok(None)` for a message that this component has no use for.
    ///
    /// # Errors
    /// See [`MessageFault`]. Nothing of a refused message may be used.
    pub fn decode(frame: &Frame) -> Result<Option<Message>, MessageFault> {
        let message = match frame.message_id {
            dialect::HEARTBEAT_DATA::ID => Message::Heartbeat(Heartbeat::read(Fields(frame.payload()))),
            dialect::SYS_STATUS_DATA::ID => Message::SysStatus(SysStatus::read(Fields(frame.payload()))),
            dialect::BATTERY_STATUS_DATA::ID => {
                Message::BatteryStatus(BatteryStatus::read(Fields(frame.payload())))
            }
            dialect::LOCAL_POSITION_NED_DATA::ID => Message::LocalPosition(LocalPosition::try_from(
                parse::<dialect::LOCAL_POSITION_NED_DATA>(frame)?,
            )?),
            dialect::GLOBAL_POSITION_INT_DATA::ID => Message::GlobalPosition(GlobalPosition::try_from(
                parse::<dialect::GLOBAL_POSITION_INT_DATA>(frame)?,
            )?),
            dialect::HOME_POSITION_DATA::ID => {
                Message::HomePosition(HomePosition::try_from(parse::<dialect::HOME_POSITION_DATA>(frame)?)?)
            }
            dialect::GPS_GLOBAL_ORIGIN_DATA::ID => {
                Message::GlobalOrigin(GlobalOrigin::try_from(parse::<dialect::GPS_GLOBAL_ORIGIN_DATA>(
                    frame,
                )?)?)
            }
            dialect::EKF_STATUS_REPORT_DATA::ID => {
                Message::EkfStatus(parse::<dialect::EKF_STATUS_REPORT_DATA>(frame)?.flags.bits())
            }
            dialect::ESTIMATOR_STATUS_DATA::ID => {
                Message::EstimatorStatus(parse::<dialect::ESTIMATOR_STATUS_DATA>(frame)?.flags.bits())
            }
            dialect::EXTENDED_SYS_STATE_DATA::ID => {
                Message::LandedState(LandedState::from_wire(Fields(frame.payload()).u8(1)))
            }
            dialect::POSITION_TARGET_LOCAL_NED_DATA::ID => {
                return Ok(FollowedTarget::read_local(Fields(frame.payload()))?.map(Message::FollowedTarget));
            }
            dialect::POSITION_TARGET_GLOBAL_INT_DATA::ID => {
                return Ok(FollowedTarget::read_global(Fields(frame.payload()))?.map(Message::FollowedTarget));
            }
            dialect::RC_CHANNELS_DATA::ID => Message::RcChannels(RcChannels::read(Fields(frame.payload()))),
            _ => return Message::decode_conversation(frame),
        };
        Ok(Some(message))
    }

    /// The messages that have a receiver.
    fn decode_conversation(frame: &Frame) -> Result<Option<Message>, MessageFault> {
        let fields = Fields(frame.payload());
        let message = match frame.message_id {
            dialect::COMMAND_LONG_DATA::ID => Message::Command(Command::read_long(frame.sender, fields)),
            dialect::COMMAND_INT_DATA::ID => Message::Command(Command::read_int(frame.sender, fields)),
            dialect::COMMAND_ACK_DATA::ID => Message::CommandAck(CommandAck::read(fields)),
            dialect::PARAM_REQUEST_LIST_DATA::ID => {
                Message::ParameterList { target: Address::new(fields.u8(0), fields.u8(1)) }
            }
            dialect::PARAM_REQUEST_READ_DATA::ID => parameter::read_request(fields, frame.payload())?,
            dialect::PARAM_SET_DATA::ID => parameter::read_set(fields, frame.payload())?,
            dialect::STATUSTEXT_DATA::ID => {
                let sent = frame.payload().get(1..).unwrap_or(&[]);
                let mut text = Vec::new();
                for byte in sent.iter().copied().take(50).take_while(|&byte| byte != 0) {
                    // It fits: 50 is the capacity.
                    let _ = text.push(byte);
                }
                Message::StatusText { severity: fields.u8(0), text }
            }
            dialect::TIMESYNC_DATA::ID => {
                // tc1 at 0, ts1 at 8, then the MAVLink 2 target; an answer has tc1.
                if fields.i64(0) != 0 {
                    return Ok(None);
                }
                let target = Address::new(fields.u8(16), fields.u8(17));
                Message::TimesyncRequest { target, asked_ns: fields.i64(8) }
            }
            dialect::TUNNEL_DATA::ID => read_tunnel(fields, frame.payload())?,
            // Target network, system and component, then the FTP header: sequence number, session, opcode.
            dialect::FILE_TRANSFER_PROTOCOL_DATA::ID => Message::FileRequest {
                target: Address::new(fields.u8(1), fields.u8(2)),
                sequence: fields.u16(3),
                session: fields.u8(5),
                opcode: fields.u8(6),
            },
            _ => return Ok(None),
        };
        Ok(Some(message))
    }

    /// Receiver of the message; [`Address::ALL`] when it names none.
    #[must_use]
    pub fn target(&self) -> Address {
        match self {
            Message::Command(command) => command.target,
            Message::CommandAck(ack) => ack.target,
            Message::ParameterList { target }
            | Message::ParameterRead { target, .. }
            | Message::ParameterSet { target, .. }
            | Message::TimesyncRequest { target, .. }
            | Message::Tunnel { target, .. }
            | Message::FileRequest { target, .. } => *target,
            _ => Address::ALL,
        }
    }
}

fn read_tunnel(fields: Fields<'_>, payload: &[u8]) -> Result<Message, MessageFault> {
    const HEADER: usize = 5;
    let length = usize::from(fields.u8(4));
    if length > TUNNEL_BYTES {
        return Err(MessageFault::Malformed);
    }
    let sent = payload.get(HEADER..).unwrap_or(&[]);
    let mut padded = TunnelPayload::new();
    for byte in sent.iter().copied().chain(core::iter::repeat(0)).take(length) {
        // It fits, as checked above.
        let _ = padded.push(byte);
    }
    Ok(Message::Tunnel {
        target: Address::new(fields.u8(2), fields.u8(3)),
        payload_type: fields.u16(0),
        payload: padded,
    })
}
