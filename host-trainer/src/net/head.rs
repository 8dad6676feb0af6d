//! The head of the baseline networks: a latent vector of the state, concatenated with the preference, then two hidden
//! layers.
//!
//! A batch holds each state once, with any number of preferences. Everything before the first hidden layer's ReLU, except
//! the preference's part of the sum, depends on the state only and is computed once per state.

use super::architecture::Samples;
use super::matrix::{CutWeights, Panels};
use super::rowwise::{rectify, rectify_backward};
use super::shape::{Linear, PREFERENCE_FEATURES, Ruler, Tensor};
use rand::Rng;
use std::ops::Range;

/// Neurons of both hidden layers (paper, section V-B).
pub const HIDDEN: usize = 256;

/// Place of the head in the flat vector.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeadLayout {
    /// First layer: weights of the state, and the bias.
    pub state: Linear,
    /// First layer: weights of the preference.
    pub preference: Linear,
    pub second: Linear,
    pub last: Linear,
}

impl HeadLayout {
    pub fn new(ruler: &mut Ruler, state_width: usize, outputs: usize) -> HeadLayout {
        HeadLayout {
            state: ruler.linear(state_width, HIDDEN),
            preference: ruler.unbiased(PREFERENCE_FEATURES, HIDDEN),
            second: ruler.linear(HIDDEN, HIDDEN),
            last: ruler.linear(HIDDEN, outputs),
        }
    }

    pub fn linears(&self) -> [Linear; 4] {
        [self.state, self.preference, self.second, self.last]
    }

    pub fn tensors(&self) -> impl Iterator<Item = Tensor> {
        let names = ["head.0", "head.0.preference", "head.1", "head.2"];
        names.into_iter().zip(self.linears()).flat_map(|(name, linear)| linear.tensors(name))
    }

    /// State and preference are both inputs of the first layer, so both count for its initialisation.
    pub fn initialise(&self, parameters: &mut [f32], rng: &mut impl Rng) {
        let first = self.state.inputs + self.preference.inputs;
        for (linear, inputs) in self.linears().into_iter().zip([first, first, HIDDEN, HIDDEN]) {
            linear.initialise(inputs, parameters, rng);
        }
    }
}

/// The preferences, and the state that each sample belongs to.
#[derive(Clone, Debug)]
pub(super) struct Preferences {
    /// `[samples, PREFERENCE_FEATURES]`.
    numbers: Vec<f32>,
    /// Index of each state's first sample, and at the end the number of all samples: `[states + 1]`.
    first_sample: Vec<usize>,
}

impl Default for Preferences {
    fn default() -> Self {
        Self { numbers: Vec::new(), first_sample: vec![0] }
    }
}

impl Samples for Preferences {
    fn clear(&mut self) {
        self.numbers.clear();
        self.first_sample.truncate(1);
    }
}

impl Preferences {
    /// Appends a state under each of these preferences.
    pub fn push(&mut self, preferences: &[[f32; PREFERENCE_FEATURES]]) {
        self.numbers.extend_from_slice(preferences.as_flattened());
        self.first_sample.push(self.samples() + preferences.len());
    }

    pub fn states(&self) -> usize {
        self.first_sample.len() - 1
    }

    pub fn samples(&self) -> usize {
        self.first_sample[self.states()]
    }

    /// The samples of a range of states.
    pub fn of(&self, states: Range<usize>) -> Range<usize> {
        self.first_sample[states.start]..self.first_sample[states.end]
    }

    fn numbers(&self, samples: Range<usize>) -> &[f32] {
        &self.numbers[samples.start * PREFERENCE_FEATURES..samples.end * PREFERENCE_FEATURES]
    }

    /// Number of samples of each state in a range.
    fn copies(&self, states: Range<usize>) -> impl Iterator<Item = usize> {
        self.first_sample[states.start..=states.end].windows(2).map(|ends| ends[1] - ends[0])
    }
}

/// Activations and gradients of the head for one chunk.
#[derive(Clone, Debug, Default)]
pub(super) struct HeadMemory {
    /// `[states, HIDDEN]`: the first layer before the preference.
    of_states: Vec<f32>,
    /// `[samples, HIDDEN]`, after ReLU.
    first: Vec<f32>,
    second: Vec<f32>,
    d_of_states: Vec<f32>,
    d_first: Vec<f32>,
    d_second: Vec<f32>,
    pub d_state: Vec<f32>,
}

impl HeadMemory {
    /// Computes the outputs of a range of states from their latent vectors.
    pub fn forward(
        &mut self,
        layout: &HeadLayout,
        (parameters, weights): (&[f32], &CutWeights),
        (latent, preferences, states): (&[f32], &Preferences, Range<usize>),
        outputs: &mut [f32],
    ) {
        let samples = preferences.of(states.clone());
        self.of_states.resize(states.len() * HIDDEN, 0.0);
        layout.state.forward(parameters, weights, latent, &mut self.of_states);
        self.first.clear();
        for (row, copies) in self.of_states.chunks_exact(HIDDEN).zip(preferences.copies(states)) {
            for _ in 0..copies {
                self.first.extend_from_slice(row);
            }
        }
        layout.preference.add_forward(weights, preferences.numbers(samples.clone()), &mut self.first);
        rectify(&mut self.first);
        self.second.resize(samples.len() * HIDDEN, 0.0);
        layout.second.forward_rectified(parameters, weights, &self.first, &mut self.second);
        layout.last.forward(parameters, weights, &self.second, outputs);
    }

    /// Backward pass of the same chunk. With `further`, the gradient with respect to the latent vectors is in `d_state`.
    pub fn backward(
        &mut self,
        layout: &HeadLayout,
        weights: &CutWeights,
        (latent, preferences, states): (&[f32], &Preferences, Range<usize>),
        (d_outputs, further): (&[f32], bool),
        (panels, gradients): (&mut Panels, &mut [f32]),
    ) {
        layout.last.backward_parameters(&self.second, d_outputs, panels, gradients);
        self.d_second.resize(self.second.len(), 0.0);
        layout.last.backward_input(weights, d_outputs, &mut self.d_second);
        rectify_backward(&self.second, &mut self.d_second);
        layout.second.backward_parameters(&self.first, &self.d_second, panels, gradients);
        self.d_first.resize(self.first.len(), 0.0);
        layout.second.backward_input(weights, &self.d_second, &mut self.d_first);
        rectify_backward(&self.first, &mut self.d_first);
        let numbers = preferences.numbers(preferences.of(states.clone()));
        layout.preference.backward_parameters(numbers, &self.d_first, panels, gradients);
        self.gather(preferences, states.clone());
        layout.state.backward_parameters(latent, &self.d_of_states, panels, gradients);
        if further {
            self.d_state.resize(states.len() * layout.state.inputs, 0.0);
            layout.state.backward_input(weights, &self.d_of_states, &mut self.d_state);
        }
    }

    /// Sums the gradients of each state's samples.
    fn gather(&mut self, preferences: &Preferences, states: Range<usize>) {
        self.d_of_states.clear();
        self.d_of_states.resize(states.len() * HIDDEN, 0.0);
        let mut d = &self.d_first[..];
        for (sum, copies) in self.d_of_states.chunks_exact_mut(HIDDEN).zip(preferences.copies(states)) {
            let (own, rest) = d.split_at(copies * HIDDEN);
            super::rowwise::add_rows(own, sum);
            d = rest;
        }
    }
}
