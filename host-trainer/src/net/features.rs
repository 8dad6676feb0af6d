//! The feed-forward network on a feature vector (paper, MOSAC-FTV): only the head.

use super::architecture::{Architecture, Samples};
use super::head::{HeadLayout, HeadMemory, Preferences};
use super::matrix::{CutWeights, Panels};
use super::shape::{DEVICES_MAX, PREFERENCE_FEATURES, Ruler, Tensor, UAV_FEATURES};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

/// Features of a device that the paper uses: the first ones of its token.
pub const VECTOR_DEVICE_FEATURES: usize = 5;
/// Features of a state: the UAV, then [`DEVICES_MAX`] devices.
pub const VECTOR_FEATURES: usize = UAV_FEATURES + DEVICES_MAX * VECTOR_DEVICE_FEATURES;
/// States that are computed together.
const CHUNK: usize = 32;

/// The network. Its fixed sizes are constants of this module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorShape {
    /// Outputs per sample.
    pub outputs: usize,
}

/// States under preferences.
#[derive(Clone, Debug, Default)]
pub struct VectorBatch {
    /// `[states, VECTOR_FEATURES]`.
    numbers: Vec<f32>,
    preferences: Preferences,
}

impl VectorBatch {
    /// Appends a normalised state under each of the preferences. Absent devices are zeros.
    pub fn push(&mut self, state: &[f32; VECTOR_FEATURES], preferences: &[[f32; PREFERENCE_FEATURES]]) {
        self.numbers.extend_from_slice(state);
        self.preferences.push(preferences);
    }

    fn states(&self, states: Range<usize>) -> &[f32] {
        &self.numbers[states.start * VECTOR_FEATURES..states.end * VECTOR_FEATURES]
    }
}

impl Samples for VectorBatch {
    fn clear(&mut self) {
        self.numbers.clear();
        self.preferences.clear();
    }
}

/// Memory for the passes.
#[derive(Clone, Debug, Default)]
pub struct VectorWorkspace {
    forward_weights: CutWeights,
    backward_weights: CutWeights,
    head: HeadMemory,
    panels: Panels,
    outputs: Vec<f32>,
    d_outputs: Vec<f32>,
}

impl VectorShape {
    /// The head, and the number of parameters.
    fn layout(self) -> (HeadLayout, usize) {
        let mut ruler = Ruler::default();
        (HeadLayout::new(&mut ruler, VECTOR_FEATURES, self.outputs), ruler.len)
    }
}

impl Architecture for VectorShape {
    type Batch = VectorBatch;
    type Workspace = VectorWorkspace;

    fn with_outputs(outputs: usize) -> VectorShape {
        VectorShape { outputs }
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn tensors(&self) -> Vec<Tensor> {
        self.layout().0.tensors().collect()
    }

    fn initialise(&self, rng: &mut ChaCha8Rng) -> Vec<f32> {
        let (layout, len) = self.layout();
        let mut parameters = vec![0.0; len];
        layout.initialise(&mut parameters, rng);
        parameters
    }

    fn forward<'a>(
        &self,
        parameters: &[f32],
        batch: &VectorBatch,
        workspace: &'a mut VectorWorkspace,
    ) -> &'a [f32] {
        let (layout, len) = self.layout();
        assert_eq!(parameters.len(), len, "the flat vector must fit the shape");
        let VectorWorkspace { forward_weights, head, outputs, .. } = workspace;
        forward_weights.cut_forward(layout.linears(), parameters);
        let preferences = &batch.preferences;
        outputs.resize(preferences.samples() * self.outputs, 0.0);
        for states in chunks(preferences.states(), CHUNK) {
            let samples = preferences.of(states.clone());
            let outputs = &mut outputs[samples.start * self.outputs..samples.end * self.outputs];
            let input = (batch.states(states.clone()), preferences, states);
            head.forward(&layout, (parameters, forward_weights), input, outputs);
        }
        outputs
    }

    fn forward_backward<'a>(
        &self,
        parameters: &[f32],
        batch: &VectorBatch,
        workspace: &'a mut VectorWorkspace,
        mut loss: impl FnMut(Range<usize>, &[f32], &mut [f32]),
        gradients: &mut [f32],
    ) -> &'a [f32] {
        let (layout, len) = self.layout();
        assert!(parameters.len() == len && gradients.len() == len, "the flat vectors must fit the shape");
        let VectorWorkspace { forward_weights, backward_weights, head, panels, outputs, d_outputs } =
            workspace;
        forward_weights.cut_forward(layout.linears(), parameters);
        backward_weights.cut_backward(layout.linears(), parameters);
        let preferences = &batch.preferences;
        outputs.resize(preferences.samples() * self.outputs, 0.0);
        for states in chunks(preferences.states(), CHUNK) {
            let samples = preferences.of(states.clone());
            let outputs = &mut outputs[samples.start * self.outputs..samples.end * self.outputs];
            let input = (batch.states(states.clone()), preferences, states);
            head.forward(&layout, (parameters, forward_weights), input.clone(), outputs);
            d_outputs.resize(outputs.len(), 0.0);
            loss(samples, outputs, d_outputs);
            head.backward(&layout, backward_weights, input, (d_outputs, false), (panels, gradients));
        }
        outputs
    }
}

/// `0..count` in ranges of at most `size`.
pub(super) fn chunks(count: usize, size: usize) -> impl Iterator<Item = Range<usize>> {
    (0..count).step_by(size).map(move |first| first..count.min(first + size))
}
