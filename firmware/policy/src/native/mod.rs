//! The native engine: the attention network without an operating system, without a heap, from weights that stay
//! where they lie (in flash).
//!
//! # Glossary
//! - **blob**: the model file of this engine (`.gln`), made from the ONNX file by [`convert`]; [`Model`] reads it
//!   in place.
//! - **lane**: the place of one token in a block.
//! - **block**: up to [`LANES`] tokens side by side, feature by feature: `[features][lanes]`. Only as many blocks
//!   are computed as the tokens present need.
//! - **panel**: the weights of [`PANEL`] neighbouring outputs of a linear layer, `[inputs][PANEL]`, so that the
//!   kernel reads them from front to back.
//!
//! # When you may trust it
//! [`Model::read`] says that a blob is whole and of this program's contract. That it is the model which was
//! trained is proven by [`crate::self_test`] with [`Model::goldens`], which every program runs before it flies.
//! Lanes without a token are computed like the others and read by nobody.
//!
//! Each number is the same chain of additions and multiplications on every machine, whatever the number of
//! lanes: a microcontroller and a host give the same bits.
//!
//! [`convert`]: crate::onnx::convert

mod attention;
mod blob;
mod forward;
mod kernel;
mod network;
mod rowwise;

pub use blob::{Aligned, BlobError, FORMAT, MAGIC, Model, WeightFormat};
pub use forward::{NativeError, NativePolicy, Workspace};

#[cfg(feature = "std")]
pub use blob::AlignedBytes;
#[cfg(feature = "std")]
pub(crate) use blob::{Header, SOURCE_BYTES, crc32};

use crate::TOKENS;

/// Width of a token and of everything that the encoder passes on.
pub(crate) const WIDTH: usize = 64;
/// Attention heads a layer.
pub(crate) const HEADS: usize = 4;
/// Width of one head.
pub(crate) const HEAD_WIDTH: usize = WIDTH / HEADS;
/// Encoder layers.
pub(crate) const LAYERS: usize = 2;
/// Width between the two feed-forward steps.
pub(crate) const FEED_FORWARD: usize = 128;
/// What the head reads: aircraft, preference, map and the pooled devices.
pub(crate) const HEAD_INPUTS: usize = 4 * WIDTH;
/// Width inside the head.
pub(crate) const HEAD_HIDDEN: usize = 64;
/// Added to the variance in every layer norm.
pub(crate) const LAYER_NORM_EPSILON: f32 = 1e-5;

/// Outputs that the kernel computes at once.
pub(crate) const PANEL: usize = 4;
/// Panels of an output with [`WIDTH`] numbers.
pub(crate) const WIDTH_PANELS: usize = WIDTH / PANEL;
/// Panels of the logits; three outputs of the last one are padding.
pub(crate) const LOGIT_PANELS: usize = 2;

/// Tokens that the kernel computes at once. With [`PANEL`] outputs, five fill the 32 registers of a Cortex-M's
/// FPU (20 sums, 5 inputs, 4 weights), and a full set of 15 tokens leaves no lane empty.
const LANES: usize = 5;
/// Blocks of a full set of tokens.
const BLOCKS: usize = TOKENS.div_ceil(LANES);

/// Numbers of up to [`LANES`] tokens.
type Block<const FEATURES: usize> = [[f32; LANES]; FEATURES];

// The aircraft, the preference and the map lie in the first block.
const _: () = assert!(LANES > crate::FIRST_DEVICE_TOKEN);
// Weights are read from flash as they lie there.
const _: () = assert!(cfg!(target_endian = "little"), "the blob is little-endian");
