//! The observation contract, the tokens, and the engines that turn them into logits.
//!
//! One builder makes the tokens for the trainer, the simulator and the aircraft, so what was trained is what
//! flies. Physical units go in; every normalisation is inside the model's graph.
//!
//! # Glossary
//! - **situation**: what the aircraft knows when it decides, in the words of `units`.
//! - **tokens**: the same as arrays of numbers in [`schema`] order: one for the aircraft, one for the preference,
//!   one for the local map (what a stay would bring, here and around), one per device.
//! - **preference**: how much data is worth against energy, `(w_data, w_energy)` with sum 1.
//! - **logits**: one number per action, in contract order; the decision is [`gleaner_units::ActionMask::argmax`].
//! - **attention**: how much each token looked at each other token in the second layer: the explanation we show.
//! - **golden pair**: tokens and the outputs they must give; every model carries some.
//!
//! # When you may trust this
//! [`Tokens`] built by [`Tokens::build`] are finite and inside the ranges of the schema whatever the situation
//! says (a device heard with an SNR that is not a number counts as not heard). An engine's answer may be trusted
//! after [`self_test`] passed with the model's own golden pairs.
//!
//! # Features
//! [`native`] is always there. `std` adds the tract engine, which loads the ONNX file on a host with an operating
//! system, and the conversion of that file for the native engine.
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
pub mod schema;
mod situation;
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
pub use engine::{Engine, EngineKind, EngineNameError};
pub use golden::{GOLDEN_TOLERANCE, Golden, SelfTestError, self_test};
pub use inference::{Attention, Inference, Policy};
pub use situation::{DeviceState, Preference, Situation};
pub use timed::Timed;
pub use tokens::{Slots, Tokens};
pub use view::View;

/// The most devices that the model sees at once.
pub const K_MAX: usize = 12;
/// Patches along one side of the local map.
pub const LOCAL_MAP_SIDE: usize = 9;
/// Patches of the local map.
pub const LOCAL_MAP_CELLS: usize = LOCAL_MAP_SIDE * LOCAL_MAP_SIDE;
/// Tokens before the first device: aircraft, preference, local map.
pub const FIRST_DEVICE_TOKEN: usize = 3;
/// Tokens of a full set, in the order aircraft, preference, local map, devices.
pub const TOKENS: usize = FIRST_DEVICE_TOKEN + K_MAX;
