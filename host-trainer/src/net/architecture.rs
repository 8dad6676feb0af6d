//! What the learners ask of a network.

use super::batch::Batch;
use super::shape::{Shape, Tensor};
use super::workspace::Workspace;
use super::{passes, shape};
use rand_chacha::ChaCha8Rng;
use std::fmt::Debug;
use std::ops::Range;

/// A network over a flat parameter vector: what a learner needs to know of it.
///
/// A batch holds samples; a sample is a state under a preference. How the samples are packed, and what copies of one
/// state share, is the network's own business.
pub trait Architecture: Copy + Debug {
    /// Samples, packed.
    type Batch: Samples;
    /// Memory of the passes, kept from call to call.
    type Workspace: Clone + Debug + Default;

    /// This network with so many outputs.
    fn with_outputs(outputs: usize) -> Self;

    /// Outputs a sample.
    fn outputs(&self) -> usize;

    /// Every tensor in the order of the flat vector, without gaps.
    fn tensors(&self) -> Vec<Tensor>;

    /// Fresh parameters.
    fn initialise(&self, rng: &mut ChaCha8Rng) -> Vec<f32>;

    /// The outputs, `[samples, outputs]`.
    ///
    /// # Panics
    /// When `parameters` does not have the length that the network asks for.
    fn forward<'a>(
        &self,
        parameters: &[f32],
        batch: &Self::Batch,
        workspace: &'a mut Self::Workspace,
    ) -> &'a [f32];

    /// The outputs, and to `gradients` the gradient of a loss is added. `loss` is called with a range of samples,
    /// their outputs, and the place for the gradients by these outputs, all of which it must write.
    ///
    /// # Panics
    /// When a length does not fit.
    fn forward_backward<'a>(
        &self,
        parameters: &[f32],
        batch: &Self::Batch,
        workspace: &'a mut Self::Workspace,
        loss: impl FnMut(Range<usize>, &[f32], &mut [f32]),
        gradients: &mut [f32],
    ) -> &'a [f32];

    /// Length of the flat parameter vector.
    fn parameter_count(&self) -> usize {
        self.tensors().iter().map(Tensor::len).sum()
    }
}

/// A batch that can be filled anew.
pub trait Samples: Clone + Debug + Default {
    /// Forgets the samples and keeps the memory.
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
}
