//! The observation contract, the tokens, and the engines that map them to logits.
//!
//! Trainer, simulator and aircraft build the tokens with the same code, so training and flight see the same inputs.
//! Inputs are in physical units; every normalisation is part of the model's graph.
//!
//! # Glossary
//! - **situation**: the aircraft's knowledge at a decision, in the types of `units`.
//! - **tokens**: the situation as arrays in [`schema`] order: one token for the aircraft, one for the preference, one for
//!   the local map (the yield of a stay here and around), one for each device.
//! - **preference**: the weights of data and energy, `(w_data, w_energy)`, with sum 1.
//! - **logits**: one number for each action, in contract order. The decision is [`gleaner_units::ActionMask::argmax`].
//! - **attention**: the attention weights of the second layer: the explanation of a decision that programs show.
//! - **golden pair**: tokens and their logits. Every model contains some.
//!
//! # When you may trust this
//! [`Tokens`] from [`Tokens::build`] are finite and inside the ranges of the schema for every situation (a device whose
//! SNR is not finite counts as unheard). The output of an engine may be trusted after [`self_test`] passed with the
//! model's golden pairs.
//!
//! # Features
//! Without features the crate is `no_std` and has no heap: tokens and the portable [`native`] engine. `std` adds the
//! vectorised native engine, the reading and conversion of ONNX files, and token tables. `tract` adds the tract engine,
//! which runs any ONNX graph.
#![cfg_attr(not(any(test, feature = "std")), no_std)]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod golden;
mod inference;
pub mod native;
mod outlook;
pub mod schema;
mod situation;
#[cfg(all(test, feature = "std"))]
mod testing;
mod timed;
mod tokens;
mod vantage;
mod view;
mod yields;

#[cfg(feature = "std")]
mod engine;
#[cfg(feature = "std")]
pub mod onnx;
#[cfg(feature = "std")]
mod token_table;

#[cfg(feature = "std")]
pub use engine::{Engine, EngineKind, EngineNameError};
pub use golden::{GOLDEN_TOLERANCE, Golden, SelfTestError, self_test};
pub use inference::{Attention, Inference, Policy};
pub use situation::{ChannelOffset, DeviceState, Preference, Situation};
pub use timed::Timed;
#[cfg(feature = "std")]
pub use token_table::TokenTable;
pub use tokens::{Slots, Tokens};
pub use view::View;

/// Most devices in one observation.
pub const K_MAX: usize = 12;
/// Patches along a side of the local map.
pub const LOCAL_MAP_SIDE: usize = 9;
/// Patches of the local map.
pub const LOCAL_MAP_CELLS: usize = LOCAL_MAP_SIDE * LOCAL_MAP_SIDE;
/// Tokens before the first device: aircraft, preference, local map.
pub const FIRST_DEVICE_TOKEN: usize = 3;
/// Tokens of a full set, in the order aircraft, preference, local map, devices.
pub const TOKENS: usize = FIRST_DEVICE_TOKEN + K_MAX;
