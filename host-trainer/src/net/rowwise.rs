//! Operations on each row alone: layer norm, ReLU, bias.

use super::lanes::{LANES, Lanes, vectorised};
use super::shape::{LAYER_NORM_EPSILON, WIDTH};

/// [`Lanes`] in one row of a token matrix.
const PARTS: usize = WIDTH / LANES;

#[inline(always)]
fn row(slice: &[f32]) -> [Lanes; PARTS] {
    let mut parts = [Lanes::ZERO; PARTS];
    for (part, numbers) in parts.iter_mut().zip(slice.chunks_exact(LANES)) {
        *part = Lanes::load(numbers);
    }
    parts
}

#[inline(always)]
fn store(parts: [Lanes; PARTS], slice: &mut [f32]) {
    for (part, numbers) in parts.into_iter().zip(slice.chunks_exact_mut(LANES)) {
        part.store(numbers);
    }
}

/// The mean over the row.
#[inline(always)]
fn mean(parts: [Lanes; PARTS]) -> f32 {
    let mut sum = Lanes::ZERO;
    for part in parts {
        sum = sum.add(part);
    }
    sum.sum() * (1.0 / WIDTH as f32)
}

#[inline(always)]
fn add_and_norm_body<const FUSED: bool>(
    skip: &[f32],
    gain: &[f32],
    bias: &[f32],
    x: &mut [f32],
    normalised: &mut [f32],
    inverse_deviation: &mut [f32],
) {
    let (gain, bias) = (row(gain), row(bias));
    let rows = skip.chunks_exact(WIDTH).zip(x.chunks_exact_mut(WIDTH));
    let kept = normalised.chunks_exact_mut(WIDTH).zip(inverse_deviation);
    for ((skip, x), (normalised, inverse_deviation)) in rows.zip(kept) {
        let mut v = row(x);
        for (v, skip) in v.iter_mut().zip(row(skip)) {
            *v = v.add(skip);
        }
        let centre = Lanes::splat(mean(v));
        let mut squares = [Lanes::ZERO; PARTS];
        for (v, square) in v.iter_mut().zip(&mut squares) {
            *v = v.sub(centre);
            *square = v.mul(*v);
        }
        let inverse = 1.0 / (mean(squares) + LAYER_NORM_EPSILON).sqrt();
        *inverse_deviation = inverse;
        let mut out = [Lanes::ZERO; PARTS];
        for part in 0..PARTS {
            v[part] = v[part].mul(Lanes::splat(inverse));
            out[part] = v[part].mul_add::<FUSED>(gain[part], bias[part]);
        }
        store(v, normalised);
        store(out, x);
    }
}

#[inline(always)]
fn norm_backward_body<const FUSED: bool>(
    gain: &[f32],
    normalised: &[f32],
    inverse_deviation: &[f32],
    d: &mut [f32],
    d_gain: &mut [f32],
    d_bias: &mut [f32],
) {
    let gain = row(gain);
    let (mut gains, mut biases) = (row(d_gain), row(d_bias));
    let kept = normalised.chunks_exact(WIDTH).zip(inverse_deviation);
    for (d, (normalised, &inverse)) in d.chunks_exact_mut(WIDTH).zip(kept) {
        let n = row(normalised);
        let mut v = row(d);
        let mut along = [Lanes::ZERO; PARTS];
        for part in 0..PARTS {
            gains[part] = v[part].mul_add::<FUSED>(n[part], gains[part]);
            biases[part] = biases[part].add(v[part]);
            v[part] = v[part].mul(gain[part]);
            along[part] = v[part].mul(n[part]);
        }
        let centre = Lanes::splat(mean(v));
        let slope = Lanes::splat(-mean(along));
        for part in 0..PARTS {
            let rest = n[part].mul_add::<FUSED>(slope, v[part].sub(centre));
            v[part] = rest.mul(Lanes::splat(inverse));
        }
        store(v, d);
    }
    store(gains, d_gain);
    store(biases, d_bias);
}

#[inline(always)]
fn rectify_backward_body<const FUSED: bool>(rectified: &[f32], d: &mut [f32]) {
    for (d, rectified) in d.iter_mut().zip(rectified) {
        *d = if *rectified > 0.0 { *d } else { 0.0 };
    }
}

#[inline(always)]
fn add_rows_body<const FUSED: bool>(rows: &[f32], sums: &mut [f32]) {
    for row in rows.chunks_exact(sums.len()) {
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += value;
        }
    }
}

vectorised! {
    /// `x = norm(x + skip) * gain + bias` for each row of [`WIDTH`]. Stores the normalised rows and the inverse of each row's
    /// standard deviation for the backward pass.
    pub(super) fn add_and_norm(
        skip: &[f32],
        gain: &[f32],
        bias: &[f32],
        x: &mut [f32],
        normalised: &mut [f32],
        inverse_deviation: &mut [f32],
    ) = add_and_norm_body
}

vectorised! {
    /// Backward pass of the norm: on entry `d` is the gradient with respect to its output, on return that with respect to its
    /// input. Adds to the gradients of gain and bias.
    pub(super) fn norm_backward(
        gain: &[f32],
        normalised: &[f32],
        inverse_deviation: &[f32],
        d: &mut [f32],
        d_gain: &mut [f32],
        d_bias: &mut [f32],
    ) = norm_backward_body
}

/// `x = max(x, 0)`.
pub(super) fn rectify(x: &mut [f32]) {
    for x in x {
        *x = if *x > 0.0 { *x } else { 0.0 };
    }
}

vectorised! {
    /// Backward pass of ReLU: sets `d` to 0 where the output was 0.
    pub(super) fn rectify_backward(rectified: &[f32], d: &mut [f32]) = rectify_backward_body
}

vectorised! {
    /// Adds all rows of a matrix with `sums.len()` columns to `sums`.
    pub(super) fn add_rows(rows: &[f32], sums: &mut [f32]) = add_rows_body
}
