//! MAVLink without I/O: bytes to messages, and the services of one component.
//!
//! # What it owns
//! The wire: framing, checksums, signatures, scaling. The services of a MAVLink component: identity, heartbeat,
//! parameters, commands and their acknowledgements, status texts, metadata. The state of the one autopilot that it
//! serves. It makes no decision about the flight: [`Component`] reports what operators and autopilot sent, and sends
//! what its owner gives it.
//!
//! # Glossary
//! - **frame**: one packet on the wire with a correct checksum; its payload is still bytes ([`Frame`]).
//! - **message**: the content of a frame, in our units ([`Message`]).
//! - **address**: system id and component id ([`Address`]); 0 stands for all of them.
//! - **autopilot**: the flight controller that this component serves ([`Autopilot`]).
//! - **operator**: a ground station that may command ([`Operators`]).
//! - **setpoint**: a position target; only the newest counts, so one that has not left is replaced.
//! - **request**: a command of ours to the autopilot, repeated until it is acknowledged ([`AutopilotCommand`]).
//! - **operator request**: a command of an operator to us ([`OperatorRequest`]).
//!
//! # When you may trust what
//! - A [`Frame`] has a correct checksum for a message of the dialect. Other bytes are counted by reason. A frame inside
//!   the payload of another frame is data: see [`FrameDecoder`].
//! - [`Component`] does not verify signatures. On a port that needs them, the program passes on only frames that
//!   [`Signing::check`] accepted.
//! - A [`Message`] has finite coordinates and a latitude and longitude that exist. The parameters of a [`Command`] are
//!   as sent, NaN included.
//! - Everything in [`Autopilot`] was sent by the served autopilot, and is forgotten when that one restarts or is lost.
//!   Ask with a maximum age where age matters.
//! - Nothing engages or moves the aircraft unless an operator on the allow-list names our exact system and component.
//! - There is no command to the autopilot for a mode in which we steer: only the pilot of the aircraft or the operator
//!   can give us control.
//!
//! # Time
//! `now` is an argument and must not go backwards. The heartbeat leaves only from [`Component::poll`]: when the
//! caller's decision loop stops, the heartbeat stops with it.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

#[cfg(test)]
extern crate std;

/// Fixed seed for property tests.
#[cfg(test)]
fn seeded() -> proptest::test_runner::Config {
    use proptest::test_runner::{Config, RngSeed};
    Config { rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..Config::default() }
}

mod address;
mod autopilot_command;
mod component;
mod event;
mod fields;
mod message;
pub mod metadata;
mod mode;
mod operators;
mod parameters;
mod service;
mod setpoint;
mod settings;
mod signing;
mod telemetry;
mod wire;

pub use address::Address;
pub use autopilot_command::AutopilotCommand;
pub use component::{Component, FILE_DATA_BYTES};
pub use event::{Event, Failsafe, OperatorRequest, Outcome, ReportBytes};
pub use message::{
    BatteryStatus, ChargeState, Command, CommandAck, CommandForm, CommandResult, FollowedTarget,
    GlobalOrigin, GlobalPosition, Heartbeat, HomePosition, LandedState, LocalPosition, Message, MessageFault,
    ParameterKey, ParameterName, RcChannels, Severity, SysStatus, SystemState, TunnelPayload, Velocity,
};
pub use mode::{Firmware, FlightMode, is_multirotor};
pub use operators::{Operator, OperatorSyntax, Operators};
pub use parameters::{Change, Enable, PARAMETERS, ParameterError, ParameterId, ParameterSpec, Parameters};
pub use service::autopilot::Autopilot;
pub use setpoint::{PositionTarget, TargetError};
pub use settings::{EngageBlock, LinkStats, NotSent, Settings, SettingsError, Status};
pub use signing::{
    SignedFrameBytes, Signing, SigningFault, SigningKey, SigningState, SigningStats, SigningTime, StateError,
    may_forward,
};
pub use telemetry::Telemetry;
pub use wire::checksum::checksum;
pub use wire::decoder::{DecodeStats, FrameDecoder};
pub use wire::frame::{Frame, MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES, SIGNATURE_BYTES, WireVersion};
pub use wire::outgoing::{Outgoing, OutgoingStats, Priority};
pub use wire::packet::{FrameBytes, Packet};

/// `TUNNEL` payload type of a radio report (postcard, as on the serial port). Above 32767: local use.
pub const TUNNEL_RADIO_REPORT: u16 = 40_000;
/// `TUNNEL` payload type of a decision record (postcard).
pub const TUNNEL_DECISION: u16 = 40_001;
