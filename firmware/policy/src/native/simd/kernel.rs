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

/// Most rows of a tile: with 16 registers, 6 x [`VECTORS`] sums, two weights, an input and a product.
const TILE: usize = 6;
/// Panels that a single row computes together: enough sums to hide the latency of an addition.
const SINGLE: usize = 4;

/// A linear layer on any number of rows: `x` is `[rows][inputs]`, `y` is `[rows][padded outputs]`.
///
/// Each output is one chain of products and sums in the order of the inputs, as in the portable kernel. Fused
/// multiply-adds or several chains for one output would round differently.
///
/// # Cost
/// `rows x inputs x outputs` multiplications and additions. Rows are processed in tiles of three to six where possible,
/// so that one load of a weight serves several rows and enough sums are in flight to hide the latency of an addition.
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
        let width = VECTORS * S::F32_LANES;
        let (scale, _) = S::as_simd_f32s(layer.scale.all());
        let (bias, _) = S::as_simd_f32s(layer.bias.all());
        let (weights, _) = S::as_simd_f32s(layer.weights.all());
        let affine: Affine<'_, S> = Affine { scale: scale.as_chunks().0, bias: bias.as_chunks().0 };
        let (weights, _) = weights.as_chunks::<VECTORS>();
        let panels = affine.bias.len();
        if rows == 1 {
            let grouped = panels - panels % SINGLE;
            for panel in (0..grouped).step_by(SINGLE) {
                let group = (&weights[panel * inputs..], affine.from(panel));
                single::<S, MODE, SINGLE>(simd, group, x, &mut y[panel * width..]);
            }
            for panel in grouped..panels {
                let group = (&weights[panel * inputs..], affine.from(panel));
                single::<S, MODE, 1>(simd, group, x, &mut y[panel * width..]);
            }
            return;
        }
        for (index, panel) in weights.chunks_exact(inputs).enumerate() {
            let mut row = 0;
            for tile in 0..tiles {
                let height = (rows - row).div_ceil(tiles - tile);
                let x = &x[row * inputs..];
                let y = &mut y[row * outputs + index * width..];
                let panel = (panel, affine.from(index));
                match height {
                    1 => several::<S, MODE, 1>(simd, panel, x, y, outputs),
                    2 => several::<S, MODE, 2>(simd, panel, x, y, outputs),
                    3 => several::<S, MODE, 3>(simd, panel, x, y, outputs),
                    4 => several::<S, MODE, 4>(simd, panel, x, y, outputs),
                    5 => several::<S, MODE, 5>(simd, panel, x, y, outputs),
                    _ => several::<S, MODE, 6>(simd, panel, x, y, outputs),
                }
                row += height;
            }
        }
    }
}

/// Scale and bias of panels.
struct Affine<'a, S: Simd> {
    scale: &'a [[S::f32s; VECTORS]],
    bias: &'a [[S::f32s; VECTORS]],
}

impl<'a, S: Simd> Affine<'a, S> {
    /// Without the first `panel` panels.
    #[inline(always)]
    fn from(&self, panel: usize) -> Affine<'a, S> {
        Affine { scale: &self.scale[panel..], bias: &self.bias[panel..] }
    }
}

/// Weights of a panel, its scale and its bias.
type Panel<'a, S> = (&'a [[<S as Simd>::f32s; VECTORS]], Affine<'a, S>);

/// One panel of `ROWS` rows.
#[inline(always)]
fn several<S: Simd, const MODE: u8, const ROWS: usize>(
    simd: S,
    (panel, affine): Panel<'_, S>,
    x: &[f32],
    y: &mut [f32],
    outputs: usize,
) {
    let inputs = panel.len();
    let rows: [&[f32]; ROWS] = array::from_fn(|row| &x[row * inputs..][..inputs]);
    let mut sums = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
    for (input, weights) in panel.iter().enumerate() {
        for row in 0..ROWS {
            add_product(simd, &mut sums[row], weights, rows[row][input]);
        }
    }
    for (row, sums) in sums.into_iter().enumerate() {
        finish::<S, MODE>(simd, sums, &affine, &mut y[row * outputs..]);
    }
}

/// `PANELS` neighbouring panels of one row.
#[inline(always)]
fn single<S: Simd, const MODE: u8, const PANELS: usize>(
    simd: S,
    (weights, affine): Panel<'_, S>,
    x: &[f32],
    y: &mut [f32],
) {
    let inputs = x.len();
    let panels: [&[[S::f32s; VECTORS]]; PANELS] =
        array::from_fn(|panel| &weights[panel * inputs..][..inputs]);
    let mut sums = [[simd.splat_f32s(0.0); VECTORS]; PANELS];
    for (input, number) in x.iter().enumerate() {
        for panel in 0..PANELS {
            add_product(simd, &mut sums[panel], &panels[panel][input], *number);
        }
    }
    for (panel, sums) in sums.into_iter().enumerate() {
        finish::<S, MODE>(simd, sums, &affine.from(panel), &mut y[panel * VECTORS * S::F32_LANES..]);
    }
}

/// `sums = sums + weights * number`, each operation rounded.
#[inline(always)]
fn add_product<S: Simd>(simd: S, sums: &mut [S::f32s; VECTORS], weights: &[S::f32s; VECTORS], number: f32) {
    let number = simd.splat_f32s(number);
    for vector in 0..VECTORS {
        sums[vector] = simd.add_f32s(sums[vector], simd.mul_f32s(weights[vector], number));
    }
}

/// Writes one row of a panel.
#[inline(always)]
fn finish<S: Simd, const MODE: u8>(simd: S, sums: [S::f32s; VECTORS], affine: &Affine<'_, S>, y: &mut [f32]) {
    let (places, _) = S::as_mut_simd_f32s(&mut y[..VECTORS * S::F32_LANES]);
    for (vector, (place, sum)) in places.iter_mut().zip(sums).enumerate() {
        let sum = simd.add_f32s(simd.mul_f32s(sum, affine.scale[0][vector]), affine.bias[0][vector]);
        *place = match MODE {
            ADD => simd.add_f32s(*place, sum),
            // In this order NaN stays NaN.
            RECTIFY => simd.max_f32s(simd.splat_f32s(0.0), sum),
            _ => sum,
        };
    }
}

/// Most rows that a layer norm sums together.
const NORM_ROWS: usize = 8;

/// Layer norm of each row of [`WIDTH`] numbers, in place, with the biased variance of PyTorch and ONNX.
///
/// The sums run over the features in order, as in the portable engine; several rows side by side hide the latency.
pub(super) struct Normalise<'a> {
    pub norm: &'a Norm,
    pub x: &'a mut [f32],
}

impl WithSimd for Normalise<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (mut rows, _) = self.x.as_chunks_mut::<WIDTH>();
        let groups = rows.len().div_ceil(NORM_ROWS);
        for group in 0..groups {
            let height = rows.len().div_ceil(groups - group);
            let (now, later) = rows.split_at_mut(height);
            rows = later;
            match height {
                1 => normalise::<S, 1>(simd, self.norm, now),
                2 => normalise::<S, 2>(simd, self.norm, now),
                3 => normalise::<S, 3>(simd, self.norm, now),
                4 => normalise::<S, 4>(simd, self.norm, now),
                5 => normalise::<S, 5>(simd, self.norm, now),
                6 => normalise::<S, 6>(simd, self.norm, now),
                7 => normalise::<S, 7>(simd, self.norm, now),
                _ => normalise::<S, 8>(simd, self.norm, now),
            }
        }
    }
}

#[inline(always)]
fn normalise<S: Simd, const ROWS: usize>(simd: S, norm: &Norm, rows: &mut [[f32; WIDTH]]) {
    let Some(rows) = rows.first_chunk_mut::<ROWS>() else { return };
    let (gain, _) = S::as_simd_f32s(norm.gain.first(WIDTH));
    let (bias, _) = S::as_simd_f32s(norm.bias.first(WIDTH));
    let sums = sum(rows, |x| x);
    for (row, sum) in rows.iter_mut().zip(sums) {
        let mean = simd.splat_f32s(sum * (1.0 / WIDTH as f32));
        for x in S::as_mut_simd_f32s(row).0 {
            *x = simd.sub_f32s(*x, mean);
        }
    }
    let squares = sum(rows, |x| x * x);
    for (row, sum) in rows.iter_mut().zip(squares) {
        let inverse = 1.0 / (sum * (1.0 / WIDTH as f32) + LAYER_NORM_EPSILON).sqrt();
        let inverse = simd.splat_f32s(inverse);
        for ((x, gain), bias) in S::as_mut_simd_f32s(row).0.iter_mut().zip(gain).zip(bias) {
            *x = simd.add_f32s(simd.mul_f32s(simd.mul_f32s(*x, inverse), *gain), *bias);
        }
    }
}

/// For each row, the sum of `term` over the features in order.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "the rows advance together")]
fn sum<const ROWS: usize>(rows: &[[f32; WIDTH]; ROWS], term: impl Fn(f32) -> f32) -> [f32; ROWS] {
    let mut sums = [0.0; ROWS];
    for feature in 0..WIDTH {
        for row in 0..ROWS {
            sums[row] += term(rows[row][feature]);
        }
    }
    sums
}
