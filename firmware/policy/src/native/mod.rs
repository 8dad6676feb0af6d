//! The native engine: the attention network without operating system or heap, with weights used where they are in flash.
//!
//! # Glossary
//! - **blob**: the model file of this engine (`.gln`), made from the ONNX file by `onnx::convert`. [`Model`] reads it in
//!   place.
//! - **lane**: the position of one token in a block.
//! - **block**: up to five tokens side by side, feature by feature: `[features][lanes]`. Only the blocks that the present
//!   tokens need are computed.
//! - **panel**: the weights of neighbouring outputs of a linear layer, `[inputs][outputs]`, so that the kernel reads them
//!   in order.
//!
//! # Two implementations, the same bits
//! - [`NativePolicy`] is portable: each number is a fixed chain of rounded operations, so every machine gives the same
//!   bits. Microcontrollers use it.
//! - `SimdPolicy` (feature `std`) computes the same chains on the host's vector unit. Its logits and its attention are
//!   equal to those of [`NativePolicy`] in every bit, so a host and a board decide alike. It does without fused
//!   multiply-adds and without sums in several parts, which round differently.
//!
//! tract and the trainer round differently. Their logits agree within [`crate::GOLDEN_TOLERANCE`], and their masked
//! decisions are the same on the 110,000 observations of `tests/tests/native_engine.rs`.
//!
//! # When you may trust it
//! [`Model::read`] checks that a blob is complete and has this program's observation contract. [`crate::self_test`] with
//! [`Model::goldens`] checks that the engine reproduces the trained model; every program runs it before flying. Lanes
//! without a token are computed like the others, and their results are not used.

mod aligned;
mod attention;
mod format;
mod forward;
mod kernel;
mod model;
mod network;
mod reader;
mod rowwise;
mod shape;
#[cfg(feature = "std")]
mod simd;

pub use aligned::Aligned;
#[cfg(feature = "std")]
pub use aligned::AlignedBytes;
pub use format::{FORMAT, MAGIC, WeightFormat};
#[cfg(feature = "std")]
pub(crate) use format::{Header, SOURCE_BYTES, crc32};
pub use forward::{NativeError, NativePolicy, Workspace};
pub use model::Model;
pub use reader::BlobError;
#[cfg(feature = "std")]
pub(crate) use shape::{
    FEED_FORWARD, HEAD_HIDDEN, HEAD_INPUTS, HEAD_WIDTH, LAYERS, LOGIT_PANELS, PANEL, WIDTH,
};
#[cfg(feature = "std")]
pub use simd::SimdPolicy;
