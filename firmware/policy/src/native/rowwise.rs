//! Operations on each token alone: layer norm and ReLU.

use super::network::Norm;
use super::shape::{Block, LANES, LAYER_NORM_EPSILON, WIDTH};

/// `x = norm(x + change) * gain + bias` for each lane, with the biased variance of PyTorch and ONNX.
pub(super) fn add_and_norm(norm: &Norm<'_>, x: &mut Block<WIDTH>, change: &Block<WIDTH>) {
    let mut mean = [0.0; LANES];
    for (x, change) in x.iter_mut().zip(change) {
        for ((x, change), mean) in x.iter_mut().zip(change).zip(&mut mean) {
            *x += change;
            *mean += *x;
        }
    }
    let mean = mean.map(|sum| sum * (1.0 / WIDTH as f32));
    let mut variance = [0.0; LANES];
    for x in x.iter_mut() {
        for ((x, mean), variance) in x.iter_mut().zip(mean).zip(&mut variance) {
            *x -= mean;
            *variance += *x * *x;
        }
    }
    let inverse = variance.map(|sum| 1.0 / libm::sqrtf(sum * (1.0 / WIDTH as f32) + LAYER_NORM_EPSILON));
    for ((x, gain), bias) in x.iter_mut().zip(norm.gain).zip(norm.bias) {
        for (x, inverse) in x.iter_mut().zip(inverse) {
            *x = *x * inverse * gain + bias;
        }
    }
}

/// ReLU; NaN stays NaN.
pub(super) fn rectify<const LANES: usize>(x: &mut [[f32; LANES]]) {
    for x in x.iter_mut().flatten() {
        *x = if *x < 0.0 { 0.0 } else { *x };
    }
}
