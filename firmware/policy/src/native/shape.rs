//! Sizes of the network and of the kernels that compute it.

use crate::schema::{DEVICE_FEATURES, PREFERENCE_FEATURES, UAV_FEATURES};
use crate::{K_MAX, LOCAL_MAP_CELLS, TOKENS};
use gleaner_units::Action;

/// Width of a token and of every encoder input and output.
pub(crate) const WIDTH: usize = 64;
/// Attention heads a layer.
pub(crate) const HEADS: usize = 4;
/// Width of one head.
pub(crate) const HEAD_WIDTH: usize = WIDTH / HEADS;
/// Encoder layers.
pub(crate) const LAYERS: usize = 2;
/// Hidden width of the feed-forward block.
pub(crate) const FEED_FORWARD: usize = 128;
/// Inputs of the head: aircraft, preference, map and the pooled devices.
pub(crate) const HEAD_INPUTS: usize = 4 * WIDTH;
/// Hidden width of the head.
pub(crate) const HEAD_HIDDEN: usize = 64;
/// Added to the variance in every layer norm.
pub(crate) const LAYER_NORM_EPSILON: f32 = 1e-5;

/// Outputs that the portable kernel computes together.
pub(crate) const PANEL: usize = 4;
/// Panels of an output of [`WIDTH`] numbers.
pub(crate) const WIDTH_PANELS: usize = WIDTH / PANEL;
/// Panels of the logits. The last panel is padded.
pub(crate) const LOGIT_PANELS: usize = Action::COUNT.div_ceil(PANEL);

/// Tokens that the portable kernel computes together. With [`PANEL`] outputs they fill the 32 registers of a Cortex-M
/// FPU (20 sums, 5 inputs, 4 weights), and 15 tokens leave no lane empty.
pub(super) const LANES: usize = 5;
/// Blocks of a full set of tokens.
pub(super) const BLOCKS: usize = TOKENS.div_ceil(LANES);

/// Features of up to [`LANES`] tokens.
pub(super) type Block<const FEATURES: usize> = [[f32; LANES]; FEATURES];

/// 32-bit words of a golden pair: the inputs, the number of devices, the logits.
pub(super) const GOLDEN_WORDS: usize =
    UAV_FEATURES + PREFERENCE_FEATURES + LOCAL_MAP_CELLS + 1 + K_MAX * DEVICE_FEATURES + Action::COUNT;

// The first block holds aircraft, preference and map.
const _: () = assert!(LANES > crate::FIRST_DEVICE_TOKEN);
// Weights are used where they are in flash, without byte swaps.
const _: () = assert!(cfg!(target_endian = "little"), "the blob is little-endian");
