//! The pilot: `poll(now, inputs) -> outputs`, the machine that flies the mission.
//!
//! It decides once per cell what the aircraft does next, and at every poll whether it may do anything at all. It has no
//! clock, no port and no heap: a program passes bytes and the time in, and carries its bytes away.
//!
//! # Glossary
//! - **mission**: the city, the fence, the terminal, the devices, the battery that may be used. Fixed in flight.
//! - **request**: off, engage, shadow, return, from the operator. Nothing engages without one.
//! - **engaged**: the policy flies. **Homing**: the guard flies the shortest way to the terminal, then lands.
//! - **passive**: the human pilot, another station or a failsafe has the aircraft. The machine is silent until a new
//!   request.
//! - **shadow**: decides and logs as if engaged, commands nothing.
//! - **guided**: the autopilot follows our targets: GUIDED on ArduPilot, OFFBOARD on PX4. The machine never requests
//!   that mode and never arms; both are the operator's.
//! - **look-ahead**: a search over tours in the on-board model that chooses the action in place of the network, see
//!   [`LookingAhead`] and `GLN_LOOKAHEAD`. A board without it decides by the network alone.
//! - **evidence**: a heartbeat in our mode, armed, that arrived after the reason for a request. See
//!   [`Fault`].
//! - **leg**: the flight to one cell centre, or the hover over it for one slot.
//! - **slot**: the time that a move takes, cell length / `GLN_SPEED`; a hover lasts one slot.
//! - **energy**: battery units left by the guard's arithmetic, capped by the measured charge at the learned price of a
//!   unit, less the landing.
//!
//! # Rooms
//! ```text
//! onboard/   bytes in, bytes out                 uses machine, link, radio
//! machine/   dispatch and transitions            uses states
//! states/    waiting, flying, landing, ...       use decide, flight
//! decide/    one decision                        uses policy, guard, lookahead
//! flight/    plan, leg, energy, stream, watches
//! mission/   mission, file, image
//! ```
//! [`Machine`] is the state machine over typed inputs. [`Onboard`] puts the MAVLink endpoint, the radio decoder and the
//! device table around it. Programs use [`Onboard`].
//!
//! # When you may trust this
//! Every target is the centre of a cell that the guard allowed, at the altitude above home that was set when the
//! mission was engaged, and finite. Setpoints, heartbeat and decisions hang off the same `poll`: when it stops, all of
//! them stop. No command that moves the aircraft leaves without evidence. The battery theorem holds as far as a unit
//! costs what was learned; see the crate `gleaner-guard`.
//!
//! # Features
//! `std` adds `mission_file`: mission files as TOML text. [`mission_image`], the mission in flash, needs none.
#![cfg_attr(not(any(test, feature = "std")), no_std)]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod decide;
mod exchange;
mod flight;
mod machine;
mod mission;
mod onboard;
mod reasons;
mod scene;
mod state;
mod states;
mod vehicle;

pub use decide::{
    ChannelAware, Decision, DecisionRecord, Deliberator, LookAheadRecord, LookingAhead, Place,
    RECORD_BYTES_MAX,
};
#[cfg(feature = "std")]
pub use decide::{
    LoggedDecision, LoggedDevice, LoggedLookAhead, LoggedMission, LookAheadReplay, Replayed, SimulatedSlot,
};
pub use exchange::{Devices, Inputs, Notice, OnStop, Outputs, RadioActivity, Request, Rules, Telemetry};
pub use machine::Machine;
#[cfg(feature = "std")]
pub use mission::file as mission_file;
pub use mission::image as mission_image;
pub use mission::{DeviceSite, MAX_DEVICES, Mission, MissionError};
pub use onboard::{Onboard, OnboardError, Settings, Stats};
pub use reasons::{Fault, Missing, ReturnReason, TakeOver};
pub use state::State;
pub use vehicle::Vehicle;

/// Time between polls by the programs. The pilot needs 20 Hz or more.
pub const POLL_INTERVAL: gleaner_units::Duration = gleaner_units::Duration::from_millis(20);

// The link and the look-ahead own these nouns; they are part of the pilot's interface.
pub use gleaner_link::{AutopilotCommand, Enable, ParameterError, ParameterId, Parameters, Severity};
pub use gleaner_lookahead::{Budget, ChannelEstimate, Expected, Source};
