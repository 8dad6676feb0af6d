//! MAVLink without I/O: bytes to messages, and the services of one component.
//!
//! # What it owns
//! The wire: framing, checksums, scaling. The manners of a MAVLink component: identity, heartbeat, parameters,
//! commands and their acknowledgements, status texts. And what is known of the one autopilot on the other end.
//! It does not own any decision about the flight: [`Component`] tells what the operator and the autopilot said,
//! and sends what it is told to send.
//!
//! # Glossary
//! - **frame**: one packet on the wire, checksum verified, payload still bytes ([`Frame`]).
//! - **message**: what a frame says, in our units ([`Message`]).
//! - **address**: system id and component id ([`Address`]); 0 stands for all of them.
//! - **autopilot**: the one flight controller that this component serves ([`Autopilot`]).
//! - **setpoint**: a position target; only the newest counts, so an unsent one is replaced.
//! - **request**: a command of ours to the autopilot, repeated until it is acknowledged ([`AutopilotCommand`]).
//! - **operator request**: what a person asked of us ([`OperatorRequest`]).
//!
//! # When you may trust what
//! - A [`Frame`] has a correct checksum for a message that the dialect knows. Bytes that are not a frame are
//!   counted by reason in [`DecodeStats`] and never end a later frame. Signatures are not verified.
//! - A [`Message`] has finite coordinates and a latitude and longitude that exist; anything else was refused
//!   and counted here. The parameters of a [`Command`] are as they came, NaN included.
//! - Everything that [`Autopilot`] tells came from the adopted autopilot, and is forgotten when that one
//!   reboots or was lost. Ask with an age where age matters.
//! - There is no way to ask the autopilot for a mode in which we steer: only the pilot of the aircraft or the
//!   operator can give control, by design.
//!
//! # Time
//! `now` is an argument and must not go backwards. The heartbeat leaves only from [`Component::poll`]: when
//! the caller's decision loop stops, the heartbeat stops with it.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

#[cfg(test)]
extern crate std;

/// The same cases in every run.
#[cfg(test)]
fn seeded() -> proptest::test_runner::Config {
    use proptest::test_runner::{Config, RngSeed};
    Config { rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..Config::default() }
}

mod address;
mod autopilot;
mod commands;
mod component;
mod event;
mod fields;
mod frame;
mod identity;
mod message;
mod mode;
mod outgoing;
mod parameter_service;
mod parameters;
mod requests;
mod setpoint;
mod steering;
mod streams;
mod text;

pub use address::Address;
pub use autopilot::{Autopilot, Failsafe};
pub use commands::OperatorRequest;
pub use component::{Component, LinkStats, NotSent, Settings, SettingsError, Status};
pub use event::{Event, TunnelPayload};
pub use frame::{DecodeStats, Frame, FrameDecoder, MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES, WireVersion};
pub use message::{
    BatteryStatus, ChargeState, Command, CommandAck, CommandForm, CommandResult, FollowedTarget,
    GlobalOrigin, GlobalPosition, Heartbeat, HomePosition, LandedState, LocalPosition, Message, MessageFault,
    ParameterKey, ParameterName, RcChannels, Severity, SysStatus, SystemState, Velocity,
};
pub use mode::{Firmware, FlightMode};
pub use outgoing::{FrameBytes, Outgoing, OutgoingStats, Packet, Priority};
pub use parameters::{Change, Enable, PARAMETERS, ParameterError, ParameterId, ParameterSpec, Parameters};
pub use requests::{AutopilotCommand, Outcome};
pub use setpoint::{PositionTarget, TargetError};

/// `TUNNEL` payload type of a radio report (postcard, as on the serial port). Above 32767: local use.
pub const TUNNEL_RADIO_REPORT: u16 = 40_000;
/// `TUNNEL` payload type of a decision record (postcard).
pub const TUNNEL_DECISION: u16 = 40_001;
