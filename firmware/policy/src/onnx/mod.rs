//! The model file: what is in it, and the engine that runs it on a host (tract).
//!
//! # The file
//! One ONNX file holds the graph, the weights and, as metadata, everything that must travel with them: who made
//! it ([`ModelCard`]), the contract it was trained for, and golden pairs. The trainer fills a [`Metadata`] and
//! calls [`seal`]; every program reads with [`TractPolicy::load_checked`].
//!
//! # When you may trust a model
//! After [`TractPolicy::load_checked`] returned it. Then the file is whole (its SHA-256 is in it), its contract
//! is this program's ([`crate::schema::hash`], K_max, action order), its inputs and outputs are the ones of
//! [`INPUTS`] and [`OUTPUTS`], and this engine on this machine reproduced the golden pairs. The seal finds
//! damage, not malice: whoever can write the file can seal it again.

mod convert;
mod tract;
mod error;
mod interface;
mod metadata;

pub use convert::{ConvertError, convert};
pub use tract::{InferError, TractPolicy};
pub use error::ModelError;
pub use interface::{INPUTS, OUTPUTS, Port};
pub use metadata::{Metadata, ModelCard, ModelInfo, seal, unseal};
/// The messages of the ONNX format.
pub use tract_onnx::pb;
