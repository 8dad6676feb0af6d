//! Convolutions without padding, as matrix products over unfolded maps (im2col).
//!
//! The layout of maps and kernels is `[height][width][channels]`, row by row from the south-west. Each row of a patch is
//! therefore one contiguous run of numbers.

use super::matrix::{CutWeights, Panels};
use super::rowwise::rectify_backward;
use super::shape::{Linear, Ruler};

/// Cells along a kernel's side (paper, section V-B).
pub const KERNEL: usize = 5;

/// One layer and the size of its input maps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Convolution {
    /// One row per filter: `[KERNEL][KERNEL][channels]`.
    pub linear: Linear,
    width: usize,
    height: usize,
    channels: usize,
}

/// Activations and gradients of a layer for one chunk.
#[derive(Clone, Debug, Default)]
pub(super) struct ConvolutionMemory {
    /// `[maps x places, KERNEL * KERNEL * channels]`.
    patches: Vec<f32>,
    /// `[maps x places, filters]`, after ReLU.
    pub out: Vec<f32>,
    d_patches: Vec<f32>,
    /// Gradient with respect to `out`.
    pub d_out: Vec<f32>,
}

impl Convolution {
    pub fn new(ruler: &mut Ruler, (width, height): (usize, usize), channels: usize, filters: usize) -> Self {
        Self { linear: ruler.linear(KERNEL * KERNEL * channels, filters), width, height, channels }
    }

    /// Width and height of the output maps.
    pub const fn size_out(&self) -> (usize, usize) {
        (self.width + 1 - KERNEL, self.height + 1 - KERNEL)
    }

    /// Numbers of one output map.
    pub const fn numbers_out(&self) -> usize {
        let (width, height) = self.size_out();
        width * height * self.linear.outputs
    }

    /// Numbers in one row of a patch.
    const fn run(&self) -> usize {
        KERNEL * self.channels
    }

    /// Calls `each` with the index in the map of each row of each patch, patch by patch.
    fn runs(&self, mut each: impl FnMut(usize)) {
        let (width_out, height_out) = self.size_out();
        for y in 0..height_out {
            for x in 0..width_out {
                for row in y..y + KERNEL {
                    each((row * self.width + x) * self.channels);
                }
            }
        }
    }

    /// `out = max(kernel * maps + bias, 0)`.
    pub fn forward(
        &self,
        parameters: &[f32],
        weights: &CutWeights,
        maps: &[f32],
        memory: &mut ConvolutionMemory,
    ) {
        memory.patches.clear();
        for map in maps.chunks_exact(self.width * self.height * self.channels) {
            self.runs(|start| memory.patches.extend_from_slice(&map[start..start + self.run()]));
        }
        let places = memory.patches.len() / self.linear.inputs;
        memory.out.resize(places * self.linear.outputs, 0.0);
        self.linear.forward_rectified(parameters, weights, &memory.patches, &mut memory.out);
    }

    /// From `memory.d_out`: adds the gradient with respect to the parameters, and writes that with respect to the maps to
    /// `d_maps` if it is given.
    pub fn backward(
        &self,
        weights: &CutWeights,
        memory: &mut ConvolutionMemory,
        d_maps: Option<&mut Vec<f32>>,
        (panels, gradients): (&mut Panels, &mut [f32]),
    ) {
        let ConvolutionMemory { patches, out, d_patches, d_out } = memory;
        rectify_backward(out, d_out);
        self.linear.backward_parameters(patches, d_out, panels, gradients);
        let Some(d_maps) = d_maps else { return };
        d_patches.resize(patches.len(), 0.0);
        self.linear.backward_input(weights, d_out, d_patches);
        let size = self.width * self.height * self.channels;
        let count = d_out.len() / self.numbers_out();
        d_maps.clear();
        d_maps.resize(count * size, 0.0);
        let mut runs = d_patches.chunks_exact(self.run());
        for d_map in d_maps.chunks_exact_mut(size) {
            self.runs(|start| {
                let place = d_map[start..].iter_mut();
                for (place, d) in place.zip(runs.next().unwrap_or_default()) {
                    *place += d;
                }
            });
        }
    }
}
