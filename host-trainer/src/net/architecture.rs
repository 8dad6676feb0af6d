//! The interface between a learning algorithm and a network.

use super::batch::Batch;
use super::shape::{Shape, TOKENS_MAX, Tensor};
use super::workspace::Workspace;
use super::{passes, shape};
use rand_chacha::ChaCha8Rng;
use std::fmt::Debug;
use std::ops::Range;

/// A network whose parameters are one flat vector.
///
/// A batch holds samples; a sample is a state under a preference. Each network packs its samples in its own way.
pub trait Architecture: Copy + Debug {
    /// Packed samples.
    type Batch: Samples;
    /// Memory for the passes, reused by every call.
    type Workspace: Clone + Debug + Default;

    /// The same network with this number of outputs.
    fn with_outputs(outputs: usize) -> Self;

    /// Outputs per sample.
    fn outputs(&self) -> usize;

    /// Every tensor in the order of the flat vector, without gaps.
    fn tensors(&self) -> Vec<Tensor>;

    /// Random initial parameters.
    fn initialise(&self, rng: &mut ChaCha8Rng) -> Vec<f32>;

    /// The outputs, `[samples, outputs]`.
    ///
    /// # Panics
    /// When `parameters` has another length than the network's.
    fn forward<'a>(
        &self,
        parameters: &[f32],
        batch: &Self::Batch,
        workspace: &'a mut Self::Workspace,
    ) -> &'a [f32];

    /// The outputs. Adds the gradient of a loss to `gradients`. `loss` receives a range of samples and their outputs, and
    /// writes the loss's gradient with respect to each of these outputs.
    ///
    /// # Panics
    /// When a length does not match.
    fn forward_backward<'a>(
        &self,
        parameters: &[f32],
        batch: &Self::Batch,
        workspace: &'a mut Self::Workspace,
        loss: impl FnMut(Range<usize>, &[f32], &mut [f32]),
        gradients: &mut [f32],
    ) -> &'a [f32];

    /// Attention in the last layer after [`Architecture::forward`] of a batch of one sample, as [`Workspace::attention`]
    /// gives it. `None` for a network without attention.
    fn attention(_: &Self::Workspace) -> Option<[[f32; TOKENS_MAX]; TOKENS_MAX]> {
        None
    }

    /// Length of the flat parameter vector.
    fn parameter_count(&self) -> usize {
        self.tensors().iter().map(Tensor::len).sum()
    }
}

/// A batch that can be refilled.
pub trait Samples: Clone + Debug + Default {
    /// Removes the samples and keeps the memory.
    fn clear(&mut self);
}

impl Samples for Batch {
    fn clear(&mut self) {
        Batch::clear(self);
    }
}

impl Architecture for Shape {
    type Batch = Batch;
    type Workspace = Workspace;

    fn with_outputs(outputs: usize) -> Shape {
        Shape { outputs, ..Shape::actor() }
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn tensors(&self) -> Vec<shape::Tensor> {
        Shape::tensors(self)
    }

    fn initialise(&self, rng: &mut ChaCha8Rng) -> Vec<f32> {
        Shape::initialise(self, rng)
    }

    fn forward<'a>(&self, parameters: &[f32], batch: &Batch, workspace: &'a mut Workspace) -> &'a [f32] {
        passes::answer(self, parameters, batch, workspace)
    }

    fn forward_backward<'a>(
        &self,
        parameters: &[f32],
        batch: &Batch,
        workspace: &'a mut Workspace,
        loss: impl FnMut(Range<usize>, &[f32], &mut [f32]),
        gradients: &mut [f32],
    ) -> &'a [f32] {
        passes::forward_backward(self, parameters, batch, workspace, loss, gradients);
        workspace.outputs()
    }

    fn attention(workspace: &Workspace) -> Option<[[f32; TOKENS_MAX]; TOKENS_MAX]> {
        Some(workspace.attention(0))
    }
}
