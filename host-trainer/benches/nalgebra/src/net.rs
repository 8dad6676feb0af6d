//! The trainer's kernels, from its sources: they are not public.
#![allow(dead_code)]

#[path = "../../../src/net/lanes.rs"]
pub mod lanes;
#[path = "../../../src/net/matrix.rs"]
pub mod matrix;
#[path = "../../../src/net/rowwise.rs"]
pub mod rowwise;
#[path = "../../../src/net/shape.rs"]
pub mod shape;

use matrix::CutWeights;
use shape::{Linear, Ruler};

/// A linear layer with its repacked weights.
pub struct Layer {
    linear: Linear,
    cut: CutWeights,
}

impl Layer {
    pub fn new(inputs: usize, outputs: usize) -> Layer {
        Layer { linear: Ruler::default().linear(inputs, outputs), cut: CutWeights::default() }
    }

    /// Repacks the weights and evaluates the layer.
    pub fn forward(&mut self, parameters: &[f32], x: &[f32], y: &mut [f32]) {
        self.cut.cut_forward([self.linear], parameters);
        self.linear.forward(parameters, &self.cut, x, y);
    }
}
