//! The networks: forward pass, backward pass, Adam, on one thread.
//!
//! [`Shape`] is the attention network of the shipped policy; [`MapShape`] and [`VectorShape`] are the paper's baselines.
//! All implement [`Architecture`]. The rest of this page describes the attention network.
//!
//! One flat `f32` vector holds all parameters of a network; [`Shape::tensors`] lists them. A sample is a set of tokens: UAV,
//! preference, local map, and one for each device that is present. A [`Batch`] packs samples without padding.
//!
//! ```text
//! uav 4 ───────► 64 ┐
//! preference 2 ► 64 ├► 2 x encoder layer ─► uav, preference, map ─┐
//! map 81 ──────► 64 │                       max over devices ─────┴► 256 ► 64 relu ► outputs
//! devices n x 7 ► 64 ┘
//! encoder layer: x = norm(x + out(attention(qkv(x)))); x = norm(x + ff2(relu(ff1(x))))
//! ```
//!
//! # When you may trust it
//! - Gradients agree with finite differences. Outputs, losses and three Adam steps agree with a recorded run of PyTorch
//!   (`tests/pytorch_fixture.rs`).
//! - The same batch gives the same bits in every run on one machine. This module also gives the same bits on all processors
//!   with AVX2.
//! - Inputs must be normalised.
//!
//! # Tensors for an exporter
//! Names, offsets and sizes come from [`Shape::tensors`]. A weight is stored as `[outputs, inputs]`, row by row, and the
//! layer computes `y = x W^T + b`:
//!
//! | name | size | |
//! |---|---|---|
//! | `project_uav`, `project_preference`, `project_map`, `project_device` `.weight` `.bias` | 64 x 4, 2, 81, 7 | |
//! | `encoder.{0,1}.qkv` `.weight` `.bias` | 192 x 64 | rows 0..64 queries, 64..128 keys, 128..192 values; head h has rows 16 h .. 16 h + 16 of each |
//! | `encoder.{0,1}.out` `.weight` `.bias` | 64 x 64 | |
//! | `encoder.{0,1}.norm1`, `.norm2` `.weight` `.bias` | 64 | epsilon 1e-5, biased variance |
//! | `encoder.{0,1}.ff1`, `.ff2` `.weight` `.bias` | 128 x 64, 64 x 128 | ReLU between |
//! | `head.0`, `head.1` `.weight` `.bias` | 64 x 256, outputs x 64 | input order uav, preference, map, pooled; ReLU between |
//!
//! Scores are divided by 4, the root of the head width. Pooling over no devices gives zeros.

mod architecture;
mod attention;
mod batch;
mod convolution;
mod features;
mod head;
mod lanes;
mod maps;
mod matrix;
mod optimiser;
mod passes;
mod rowwise;
mod shape;
mod workspace;

#[cfg(test)]
mod baseline_tests;
#[cfg(test)]
mod tests;

pub use architecture::{Architecture, Samples};
pub use batch::{Batch, DeviceFeatures, Sample};
pub use features::{VECTOR_DEVICE_FEATURES, VECTOR_FEATURES, VectorBatch, VectorShape, VectorWorkspace};
pub use maps::{
    GLOBAL_NUMBERS, GLOBAL_SIZE, GLOBAL_WINDOW, LOCAL_NUMBERS, LOCAL_SIDE, MAP_CHANNELS, MapBatch, MapShape,
    MapWorkspace,
};
pub use optimiser::{Adam, polyak};
pub use passes::{answer, backward, forward, forward_backward};
pub use shape::{
    DEVICE_FEATURES, DEVICES_MAX, FIXED_TOKENS, HEAD_WIDTH, HEADS, LAYER_NORM_EPSILON, LAYERS, MAP_CELLS,
    PREFERENCE_FEATURES, Shape, TOKENS_MAX, Tensor, UAV_FEATURES, WIDTH,
};
pub use workspace::Workspace;
