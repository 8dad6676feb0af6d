//! Memory for the two passes, reused by every call.

use std::ops::Range;

use super::batch::Batch;
use super::lanes::LANES;
use super::matrix::{CutWeights, Panels};
use super::shape::{FIXED_TOKENS, HEAD_INPUTS, HEADS, LAYERS, Shape, TOKENS_MAX, WIDTH};

/// Attention probabilities of one token: [`LANES`] for each head.
pub(super) const KEPT: usize = HEADS * LANES;

/// Samples that are computed together: their activations fit into the second-level cache. Fixed, because the sums of
/// gradients depend on it.
pub(super) const CHUNK: usize = 16;

/// The rows of each sample's tokens in a chunk's matrices.
///
/// Rows are in the order of the kinds: all UAVs, all preferences, all maps, all devices, so that each projector writes
/// one block. A sample's tokens are in the order UAV, preference, map, devices.
#[derive(Clone, Debug, Default)]
pub(super) struct Tokens {
    rows: Vec<u32>,
    /// Index in `rows` of each sample's first token, and the end: `[samples + 1]`.
    starts: Vec<usize>,
}

impl Tokens {
    fn lay_out(&mut self, batch: &Batch, samples: Range<usize>) {
        self.rows.clear();
        self.starts.clear();
        self.starts.push(0);
        let count = samples.len();
        let mut device = FIXED_TOKENS * count;
        for (index, sample) in samples.enumerate() {
            self.rows.extend((0..FIXED_TOKENS).map(|kind| (kind * count + index) as u32));
            let end = device + batch.device_count(sample);
            self.rows.extend((device..end).map(|row| row as u32));
            device = end;
            self.starts.push(self.rows.len());
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// For each sample: the number of tokens before it, and its rows.
    pub fn samples(&self) -> impl Iterator<Item = (usize, &[u32])> {
        self.starts.windows(2).map(|ends| (ends[0], &self.rows[ends[0]..ends[1]]))
    }
}

/// Activations of one encoder layer for the backward pass. Matrices have one row per token.
#[derive(Clone, Debug, Default)]
pub(super) struct LayerActivations {
    pub qkv: Vec<f32>,
    pub probabilities: Vec<f32>,
    pub mixed: Vec<f32>,
    pub normalised1: Vec<f32>,
    pub inverse_deviation1: Vec<f32>,
    /// After the first norm.
    pub middle: Vec<f32>,
    pub hidden: Vec<f32>,
    pub normalised2: Vec<f32>,
    pub inverse_deviation2: Vec<f32>,
    /// After the second norm: the layer's output.
    pub out: Vec<f32>,
}

/// Activations of one chunk for the backward pass.
#[derive(Clone, Debug, Default)]
pub(super) struct Activations {
    pub samples: Range<usize>,
    pub devices: Range<usize>,
    pub tokens: Tokens,
    pub embedded: Vec<f32>,
    pub layers: [LayerActivations; LAYERS],
    /// `[samples, HEAD_INPUTS]`: UAV, preference, map, pooled devices.
    pub joined: Vec<f32>,
    /// `[samples, WIDTH]`: the row of each maximum.
    pub pooled_from: Vec<u32>,
    pub hidden: Vec<f32>,
}

impl Activations {
    /// Sets the sizes for the samples of one chunk.
    pub fn prepare(&mut self, shape: Shape, batch: &Batch, samples: Range<usize>) {
        assert!(
            batch.local_map.len() == batch.len() * shape.map_cells
                && batch.devices.len() == batch.device_total() * shape.device_features,
            "samples of another network"
        );
        self.devices = batch.first_device[samples.start]..batch.first_device[samples.end];
        self.tokens.lay_out(batch, samples.clone());
        let tokens = self.tokens.len();
        self.embedded.resize(tokens * WIDTH, 0.0);
        for layer in &mut self.layers {
            layer.qkv.resize(tokens * 3 * WIDTH, 0.0);
            layer.probabilities.resize(tokens * KEPT, 0.0);
            layer.hidden.resize(tokens * shape.feed_forward, 0.0);
            layer.inverse_deviation1.resize(tokens, 0.0);
            layer.inverse_deviation2.resize(tokens, 0.0);
            for matrix in [
                &mut layer.mixed,
                &mut layer.normalised1,
                &mut layer.middle,
                &mut layer.normalised2,
                &mut layer.out,
            ] {
                matrix.resize(tokens * WIDTH, 0.0);
            }
        }
        self.joined.resize(samples.len() * HEAD_INPUTS, 0.0);
        self.pooled_from.resize(samples.len() * WIDTH, 0);
        self.hidden.resize(samples.len() * shape.head, 0.0);
        self.samples = samples;
    }

    /// The chunk's part of the batch's matrices (UAVs, preferences, maps, devices) with these numbers of columns.
    pub fn inputs<'a>(&self, batch: &'a Batch, columns: [usize; 4]) -> [&'a [f32]; 4] {
        let part = |matrix: &'a [f32], rows: &Range<usize>, columns: usize| {
            &matrix[rows.start * columns..rows.end * columns]
        };
        [
            part(&batch.uav, &self.samples, columns[0]),
            part(&batch.preference, &self.samples, columns[1]),
            part(&batch.local_map, &self.samples, columns[2]),
            part(&batch.devices, &self.devices, columns[3]),
        ]
    }
}

/// Gradients with respect to the activations of one chunk.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    pub panels: Panels,
    pub d_outputs: Vec<f32>,
    pub d_tokens: Vec<f32>,
    pub d_mixed: Vec<f32>,
    pub d_qkv: Vec<f32>,
    pub d_hidden: Vec<f32>,
    pub d_joined: Vec<f32>,
    pub d_head: Vec<f32>,
}

impl Scratch {
    /// Sets the sizes for one chunk. The matrices keep old values.
    pub fn prepare(&mut self, chunk: &Activations) {
        let layer = &chunk.layers[0];
        for (matrix, like) in [
            (&mut self.d_tokens, &chunk.embedded),
            (&mut self.d_mixed, &layer.mixed),
            (&mut self.d_qkv, &layer.qkv),
            (&mut self.d_hidden, &layer.hidden),
            (&mut self.d_joined, &chunk.joined),
            (&mut self.d_head, &chunk.hidden),
        ] {
            matrix.resize(like.len(), 0.0);
        }
    }
}

/// All memory for [`super::forward`] and [`super::backward`]. It grows to the largest batch and never shrinks, so that later
/// passes do not allocate.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    pub(super) forward_weights: CutWeights,
    pub(super) backward_weights: CutWeights,
    pub(super) chunks: Vec<Activations>,
    pub(super) scratch: Scratch,
    /// `[samples, outputs]` of the last forward pass.
    pub(super) outputs: Vec<f32>,
}

impl Workspace {
    /// An empty workspace.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Outputs of the last forward pass, `[samples, outputs]`.
    #[must_use]
    pub fn outputs(&self) -> &[f32] {
        &self.outputs
    }

    /// Attention of the second layer in the last [`super::forward`], mean over the heads, as `[query][key]`.
    ///
    /// Token order: UAV, preference, local map, devices. Rows and columns of absent devices are 0; all other rows sum to 1.
    ///
    /// # Panics
    /// When `sample` was not in the batch.
    #[must_use]
    pub fn attention(&self, sample: usize) -> [[f32; TOKENS_MAX]; TOKENS_MAX] {
        let chunk = &self.chunks[sample / CHUNK];
        let Some((start, rows)) = chunk.tokens.samples().nth(sample % CHUNK) else {
            panic!("sample {sample} was not in the batch");
        };
        let count = rows.len();
        let kept = &chunk.layers[LAYERS - 1].probabilities[start * KEPT..(start + count) * KEPT];
        let mut mean = [[0.0; TOKENS_MAX]; TOKENS_MAX];
        for head in kept.chunks_exact(count * LANES) {
            for (mean, row) in mean.iter_mut().zip(head.chunks_exact(LANES)) {
                for (mean, probability) in mean.iter_mut().zip(&row[..count]) {
                    *mean += probability * (1.0 / HEADS as f32);
                }
            }
        }
        mean
    }
}
