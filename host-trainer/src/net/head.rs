//! The head of the baselines: what is known of a state, then the preference beside it, then two hidden layers.
//!
//! A batch holds each state once and any number of preferences for it. What does not depend on the preference, and
//! that is everything before the first hidden layer's rectifier, is worked out once a state.

use super::architecture::Samples;
use super::matrix::{CutWeights, Panels};
use super::rowwise::{rectify, rectify_backward};
use super::shape::{Linear, PREFERENCE_FEATURES, Ruler, Tensor};
use rand::Rng;
use std::ops::Range;

/// Neurons of both hidden layers (paper, section V-B).
pub const HIDDEN: usize = 256;

/// Where the head lies in the flat vector.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeadLayout {
    /// The first layer's part for the state, with the bias.
    pub state: Linear,
    /// The first layer's part for the preference.
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

    /// State and preference enter the first layer side by side, so both count as its inputs.
    pub fn initialise(&self, parameters: &mut [f32], rng: &mut impl Rng) {
        let first = self.state.inputs + self.preference.inputs;
        for (linear, inputs) in self.linears().into_iter().zip([first, first, HIDDEN, HIDDEN]) {
            linear.initialise(inputs, parameters, rng);
        }
    }
}

/// Which samples are of which state, and their preferences.
#[derive(Clone, Debug)]
pub(super) struct Preferences {
    /// `[samples, PREFERENCE_FEATURES]`.
    numbers: Vec<f32>,
    /// First sample of each state and, last, the number of all samples: `[states + 1]`.
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

    /// The samples of some states.
    pub fn of(&self, states: Range<usize>) -> Range<usize> {
        self.first_sample[states.start]..self.first_sample[states.end]
    }

    fn numbers(&self, samples: Range<usize>) -> &[f32] {
        &self.numbers[samples.start * PREFERENCE_FEATURES..samples.end * PREFERENCE_FEATURES]
    }

    /// How many samples each of some states has.
    fn copies(&self, states: Range<usize>) -> impl Iterator<Item = usize> {
        self.first_sample[states.start..=states.end].windows(2).map(|ends| ends[1] - ends[0])
    }
}

/// What the head keeps of one chunk, and the gradients on their way back.
#[derive(Clone, Debug, Default)]
pub(super) struct HeadMemory {
    /// `[states, HIDDEN]`: the first layer before the preference.
    of_states: Vec<f32>,
    /// `[samples, HIDDEN]`, after the rectifier.
    first: Vec<f32>,
    second: Vec<f32>,
    d_of_states: Vec<f32>,
    d_first: Vec<f32>,
    d_second: Vec<f32>,
    pub d_state: Vec<f32>,
}

impl HeadMemory {
    /// From the latent vectors of some states to the outputs of their samples.
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

    /// The way back of the same chunk; leaves the gradient of the latent vectors in `d_state` when `further`.
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
