//! Linear layers and layer norms on vector registers.
#![expect(
    clippy::indexing_slicing,
    reason = "constant indices below constant lengths, in loops that must unroll"
)]

use super::pack::{Norm, Packed, VECTORS};
use crate::native::shape::{LAYER_NORM_EPSILON, WIDTH};
use core::array;
use pulp::{Simd, WithSimd};

/// What a product does to `y`: `y = x W^T + b`.
pub(super) const STORE: u8 = 0;
/// `y = y + x W^T + b`.
pub(super) const ADD: u8 = 1;
/// `y = max(0, x W^T + b)`.
pub(super) const RECTIFY: u8 = 2;

/// Most rows of a tile: with 16 registers, 6 x [`VECTORS`] sums, two weights and an input.
const TILE: usize = 6;

/// A linear layer on any number of rows: `x` is `[rows][inputs]`, `y` is `[rows][padded outputs]`.
///
/// # Cost
/// `rows x inputs x outputs` multiply-adds. Rows are processed in tiles of three to six where possible, so that one load
/// of a weight serves several rows and enough sums are in flight to hide the latency of a multiply-add.
pub(super) struct Multiply<'a, const MODE: u8> {
    pub layer: &'a Packed,
    pub x: &'a [f32],
    pub y: &'a mut [f32],
}

impl<const MODE: u8> WithSimd for Multiply<'_, MODE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Multiply { layer, x, y } = self;
        let (inputs, outputs) = (layer.inputs, layer.outputs());
        let rows = x.len() / inputs;
        let tiles = rows.div_ceil(TILE);
        let (bias, _) = S::as_simd_f32s(layer.bias.all());
        let (weights, _) = S::as_simd_f32s(layer.weights.all());
        let (bias, _) = bias.as_chunks::<VECTORS>();
        let (weights, _) = weights.as_chunks::<VECTORS>();
        for (index, (panel, bias)) in weights.chunks_exact(inputs).zip(bias).enumerate() {
            let mut row = 0;
            for tile in 0..tiles {
                let height = (rows - row).div_ceil(tiles - tile);
                let x = &x[row * inputs..];
                let y = &mut y[row * outputs + index * VECTORS * S::F32_LANES..];
                match height {
                    1 => single::<S, MODE>(simd, panel, bias, x, y),
                    2 => several::<S, MODE, 2>(simd, panel, bias, x, y, outputs),
                    3 => several::<S, MODE, 3>(simd, panel, bias, x, y, outputs),
                    4 => several::<S, MODE, 4>(simd, panel, bias, x, y, outputs),
                    5 => several::<S, MODE, 5>(simd, panel, bias, x, y, outputs),
                    _ => several::<S, MODE, 6>(simd, panel, bias, x, y, outputs),
                }
                row += height;
            }
        }
    }
}

/// One panel of `ROWS` rows.
#[inline(always)]
fn several<S: Simd, const MODE: u8, const ROWS: usize>(
    simd: S,
    panel: &[[S::f32s; VECTORS]],
    bias: &[S::f32s; VECTORS],
    x: &[f32],
    y: &mut [f32],
    outputs: usize,
) {
    let inputs = panel.len();
    let rows: [&[f32]; ROWS] = array::from_fn(|row| &x[row * inputs..][..inputs]);
    let mut sums = [*bias; ROWS];
    for (input, weights) in panel.iter().enumerate() {
        for row in 0..ROWS {
            let number = simd.splat_f32s(rows[row][input]);
            for vector in 0..VECTORS {
                sums[row][vector] = simd.mul_add_e_f32s(weights[vector], number, sums[row][vector]);
            }
        }
    }
    for (row, sums) in sums.into_iter().enumerate() {
        finish::<S, MODE>(simd, sums, &mut y[row * outputs..]);
    }
}

/// One panel of one row, with four chains of sums.
#[inline(always)]
fn single<S: Simd, const MODE: u8>(
    simd: S,
    panel: &[[S::f32s; VECTORS]],
    bias: &[S::f32s; VECTORS],
    x: &[f32],
    y: &mut [f32],
) {
    const CHAINS: usize = 4;
    let x = &x[..panel.len()];
    let mut sums = [[simd.splat_f32s(0.0); VECTORS]; CHAINS];
    let (groups, rest) = panel.as_chunks::<CHAINS>();
    let (numbers, rest_numbers) = x.as_chunks::<CHAINS>();
    for (weights, numbers) in groups.iter().zip(numbers) {
        for chain in 0..CHAINS {
            let number = simd.splat_f32s(numbers[chain]);
            for vector in 0..VECTORS {
                sums[chain][vector] =
                    simd.mul_add_e_f32s(weights[chain][vector], number, sums[chain][vector]);
            }
        }
    }
    let mut total = *bias;
    for (weights, number) in rest.iter().zip(rest_numbers) {
        let number = simd.splat_f32s(*number);
        for vector in 0..VECTORS {
            total[vector] = simd.mul_add_e_f32s(weights[vector], number, total[vector]);
        }
    }
    for vector in 0..VECTORS {
        let [a, b, c, d] = array::from_fn(|chain| sums[chain][vector]);
        let pairs = simd.add_f32s(simd.add_f32s(a, b), simd.add_f32s(c, d));
        total[vector] = simd.add_f32s(total[vector], pairs);
    }
    finish::<S, MODE>(simd, total, y);
}

/// Writes one row of a panel.
#[inline(always)]
fn finish<S: Simd, const MODE: u8>(simd: S, sums: [S::f32s; VECTORS], y: &mut [f32]) {
    let (places, _) = S::as_mut_simd_f32s(&mut y[..VECTORS * S::F32_LANES]);
    for (place, sum) in places.iter_mut().zip(sums) {
        *place = match MODE {
            ADD => simd.add_f32s(*place, sum),
            // In this order NaN stays NaN.
            RECTIFY => simd.max_f32s(simd.splat_f32s(0.0), sum),
            _ => sum,
        };
    }
}

/// Layer norm of each row of [`WIDTH`] numbers, in place, with the biased variance of PyTorch and ONNX.
pub(super) struct Normalise<'a> {
    pub norm: &'a Norm,
    pub x: &'a mut [f32],
}

impl WithSimd for Normalise<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (gain, _) = S::as_simd_f32s(self.norm.gain.first(WIDTH));
        let (bias, _) = S::as_simd_f32s(self.norm.bias.first(WIDTH));
        let (rows, _) = self.x.as_chunks_mut::<WIDTH>();
        for row in rows {
            let (row, _) = S::as_mut_simd_f32s(row);
            let mut sum = simd.splat_f32s(0.0);
            for x in row.iter() {
                sum = simd.add_f32s(sum, *x);
            }
            let mean = simd.splat_f32s(simd.reduce_sum_f32s(sum) * (1.0 / WIDTH as f32));
            let mut squares = simd.splat_f32s(0.0);
            for x in row.iter_mut() {
                *x = simd.sub_f32s(*x, mean);
                squares = simd.mul_add_e_f32s(*x, *x, squares);
            }
            let variance = simd.reduce_sum_f32s(squares) * (1.0 / WIDTH as f32);
            let inverse = simd.splat_f32s(1.0 / (variance + LAYER_NORM_EPSILON).sqrt());
            for ((x, gain), bias) in row.iter_mut().zip(gain).zip(bias) {
                *x = simd.mul_add_e_f32s(simd.mul_f32s(*x, inverse), *gain, *bias);
            }
        }
    }
}
