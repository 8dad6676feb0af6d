//! The model file: its contents, the conversion for the native engine, and the tract engine (feature `tract`).
//!
//! # The file
//! One ONNX file contains the graph, the weights and, as metadata, the model's origin ([`ModelCard`]), its observation
//! contract and its golden pairs. The trainer fills a [`Metadata`] and calls [`seal`]; every program reads the file with
//! [`unseal`] or `TractPolicy::load_checked`.
//!
//! # When you may trust a model
//! After [`crate::Engine::load_checked`] or `TractPolicy::load_checked` returned it. Then the file matches its SHA-256,
//! its contract is this program's ([`crate::schema::hash`], K_max, action order), its inputs and outputs are [`INPUTS`]
//! and [`OUTPUTS`], and the engine reproduced the golden pairs on this machine. The seal detects damage, not
//! manipulation: anyone who can write the file can seal it again.

mod convert;
mod error;
mod interface;
mod metadata;
pub mod pb;
#[cfg(feature = "tract")]
mod tract;

pub use convert::convert;
pub use error::{ConvertError, InferError, ModelError};
pub use interface::{INPUTS, OUTPUTS, Port};
pub use metadata::{Metadata, ModelCard, ModelInfo, seal, unseal};
#[cfg(feature = "tract")]
pub use tract::TractPolicy;
