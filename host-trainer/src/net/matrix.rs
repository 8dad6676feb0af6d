//! The three matrix products of a linear layer: forward, and backward for its input and for its weights.
//!
//! All matrices are stored row by row. Weights are first repacked into panels of sixteen columns, once per batch, so that
//! the inner loop reads memory in order. It keeps a tile of a few rows by sixteen columns in registers. Each number of a
//! product is summed in the order of the inner index, so the results do not depend on the size of the tile.
//!
//! # Why not nalgebra
//! nalgebra (0.34, with matrixmultiply 0.3) is as fast: on an AMD EPYC of the Zen 3 family its time for 864 x 64 x 192 is
//! 1.00 times ours (quartiles 0.66 and 1.53 on a busy machine; minima 1.05), and for 9 rows 0.79 times, because ours then
//! repacks the weights for few rows (`cargo run --release --manifest-path host-trainer/benches/nalgebra/Cargo.toml`).
//! These kernels remain for two other reasons. The order of each sum is fixed, so that a training run continues to the same
//! bits on any processor with AVX2. Bias, ReLU and accumulation are part of the write-back and cost no pass over memory.

use super::lanes::{LANES, Lanes, vectorised};
use super::rowwise::add_rows;
use super::shape::Linear;

/// Rows of a tile: with AVX2, six rows of sixteen numbers occupy twelve of the sixteen registers.
const TILE: usize = 6;

/// A matrix in panels of [`LANES`] columns. The last panel is padded with zeros.
#[derive(Clone, Debug, Default)]
pub(super) struct Panels {
    numbers: Vec<f32>,
    rows: usize,
    columns: usize,
}

impl Panels {
    fn prepare(&mut self, rows: usize, columns: usize) {
        (self.rows, self.columns) = (rows, columns);
        self.numbers.clear();
        self.numbers.resize(columns.div_ceil(LANES) * rows * LANES, 0.0);
    }

    /// Repacks a matrix of `columns` columns.
    pub fn cut(&mut self, matrix: &[f32], columns: usize) {
        self.prepare(matrix.len() / columns, columns);
        let panels = self.numbers.chunks_exact_mut(self.rows * LANES);
        for (first, panel) in (0..columns).step_by(LANES).zip(panels) {
            let width = LANES.min(columns - first);
            for (row, place) in matrix.chunks_exact(columns).zip(panel.chunks_exact_mut(LANES)) {
                place[..width].copy_from_slice(&row[first..first + width]);
            }
        }
    }

    /// Repacks the transpose of a matrix of `columns` columns.
    pub fn cut_transposed(&mut self, matrix: &[f32], columns: usize) {
        self.prepare(columns, matrix.len() / columns);
        let panels = self.numbers.chunks_exact_mut(self.rows * LANES);
        for (rows, panel) in matrix.chunks(LANES * columns).zip(panels) {
            for (lane, row) in rows.chunks_exact(columns).enumerate() {
                for (place, &value) in panel.chunks_exact_mut(LANES).zip(row) {
                    place[lane] = value;
                }
            }
        }
    }
}

/// How a product is written.
#[derive(Clone, Copy, PartialEq)]
enum Then {
    Store,
    Add,
    Rectify,
}

/// Writes one row of a tile.
#[inline(always)]
fn finish(value: Lanes, then: Then, place: &mut [f32]) {
    if let Some(place) = place.first_chunk_mut::<LANES>() {
        match then {
            Then::Store => *place = value.0,
            Then::Add => *place = Lanes(*place).add(value).0,
            Then::Rectify => *place = value.rectified().0,
        }
        return;
    }
    for (place, &value) in place.iter_mut().zip(&value.0) {
        *place = match then {
            Then::Store => value,
            Then::Add => *place + value,
            Then::Rectify => value.max(0.0),
        };
    }
}

/// `start` plus [`TILE`] rows of `a` times one panel.
#[inline(always)]
fn tile<const FUSED: bool>(a: &[f32], inner: usize, panel: &[f32], start: Lanes) -> [Lanes; TILE] {
    let (a0, a) = a.split_at(inner);
    let (a1, a) = a.split_at(inner);
    let (a2, a) = a.split_at(inner);
    let (a3, a) = a.split_at(inner);
    let (a4, a5) = a.split_at(inner);
    let mut sums = [start; TILE];
    let a = a0.iter().zip(a1).zip(a2).zip(a3).zip(a4).zip(a5);
    for ((((((a0, a1), a2), a3), a4), a5), b) in a.zip(panel.as_chunks::<LANES>().0) {
        let a = [a0, a1, a2, a3, a4, a5];
        for row in 0..TILE {
            sums[row] = Lanes::splat(*a[row]).mul_add::<FUSED>(Lanes(*b), sums[row]);
        }
    }
    // Otherwise LLVM may keep a row in four half registers, run out of registers, and wait for the stack in the loop.
    std::hint::black_box(sums)
}

/// One row times one panel.
#[inline(always)]
fn single<const FUSED: bool>(a: &[f32], panel: &[f32], start: Lanes) -> Lanes {
    let mut sum = start;
    for (a, b) in a.iter().zip(panel.as_chunks::<LANES>().0) {
        sum = Lanes::splat(*a).mul_add::<FUSED>(Lanes(*b), sum);
    }
    sum
}

/// As [`tile`], for the transpose of `a` from column `first`.
#[inline(always)]
fn tile_of_transpose<const FUSED: bool, const ROWS: usize>(
    a: &[f32],
    columns: usize,
    first: usize,
    panel: &[f32],
) -> [Lanes; ROWS] {
    let mut sums = [Lanes::ZERO; ROWS];
    for (a, b) in a.chunks_exact(columns).zip(panel.as_chunks::<LANES>().0) {
        let Some(a) = a[first..].first_chunk::<ROWS>() else { break };
        for row in 0..ROWS {
            sums[row] = Lanes::splat(a[row]).mul_add::<FUSED>(Lanes(*b), sums[row]);
        }
    }
    sums
}

#[inline(always)]
fn product_body<const FUSED: bool>(a: &[f32], b: &Panels, bias: &[f32], then: Then, c: &mut [f32]) {
    let (inner, columns) = (b.rows, b.columns);
    for (first, panel) in (0..columns).step_by(LANES).zip(b.numbers.chunks_exact(inner * LANES)) {
        let width = LANES.min(columns - first);
        let mut start = Lanes::ZERO;
        for (start, bias) in start.0.iter_mut().zip(bias.iter().skip(first)) {
            *start = *bias;
        }
        let blocks = a.chunks(TILE * inner).zip(c.chunks_mut(TILE * columns));
        for (a, c) in blocks {
            if a.len() == TILE * inner {
                let sums = tile::<FUSED>(a, inner, panel, start);
                for (value, c) in sums.into_iter().zip(c.chunks_exact_mut(columns)) {
                    finish(value, then, &mut c[first..first + width]);
                }
            } else {
                for (a, c) in a.chunks_exact(inner).zip(c.chunks_exact_mut(columns)) {
                    let value = single::<FUSED>(a, panel, start);
                    finish(value, then, &mut c[first..first + width]);
                }
            }
        }
    }
}

#[inline(always)]
fn add_transposed_product_body<const FUSED: bool>(a: &[f32], a_columns: usize, b: &Panels, c: &mut [f32]) {
    let columns = b.columns;
    for (first, panel) in (0..columns).step_by(LANES).zip(b.numbers.chunks_exact(b.rows * LANES)) {
        let width = LANES.min(columns - first);
        let mut at = 0;
        for c in c[..a_columns / TILE * TILE * columns].chunks_exact_mut(TILE * columns) {
            add_tile::<FUSED, TILE>(a, a_columns, at, panel, (first, width), columns, c);
            at += TILE;
        }
        // The remainder in as few tiles as possible: single rows are slow, because each addition waits for the one before.
        let mut c = &mut c[at * columns..];
        if a_columns - at >= 4 {
            add_tile::<FUSED, 4>(a, a_columns, at, panel, (first, width), columns, &mut c[..4 * columns]);
            c = &mut c[4 * columns..];
            at += 4;
        }
        for c in c.chunks_exact_mut(columns) {
            add_tile::<FUSED, 1>(a, a_columns, at, panel, (first, width), columns, c);
            at += 1;
        }
    }
}

/// Adds `ROWS` rows of the transposed product, from row `at` on, to the columns of one panel.
#[inline(always)]
fn add_tile<const FUSED: bool, const ROWS: usize>(
    a: &[f32],
    a_columns: usize,
    at: usize,
    panel: &[f32],
    (first, width): (usize, usize),
    columns: usize,
    c: &mut [f32],
) {
    let sums = tile_of_transpose::<FUSED, ROWS>(a, a_columns, at, panel);
    for (value, c) in sums.into_iter().zip(c.chunks_exact_mut(columns)) {
        finish(value, Then::Add, &mut c[first..first + width]);
    }
}

vectorised! {
    /// `c = then(a b + bias)`, or `c += a b + bias`. Missing entries of `bias` are 0.
    fn product(a: &[f32], b: &Panels, bias: &[f32], then: Then, c: &mut [f32]) = product_body
}

vectorised! {
    /// `c += a^T b`.
    fn add_transposed_product(a: &[f32], a_columns: usize, b: &Panels, c: &mut [f32]) =
        add_transposed_product_body
}

/// The weights of all linear layers in panels, by [`Linear::index`].
#[derive(Clone, Debug, Default)]
pub(super) struct CutWeights(Vec<Panels>);

impl CutWeights {
    fn cut(&mut self, linears: impl IntoIterator<Item = Linear>, mut cut: impl FnMut(&Linear, &mut Panels)) {
        for linear in linears {
            if self.0.len() <= linear.index {
                self.0.resize_with(linear.index + 1, Panels::default);
            }
            cut(&linear, &mut self.0[linear.index]);
        }
    }

    /// Repacks the weights of these layers for the forward pass.
    pub fn cut_forward(&mut self, linears: impl IntoIterator<Item = Linear>, parameters: &[f32]) {
        self.cut(linears, |linear, panels| panels.cut_transposed(linear.weight(parameters), linear.inputs));
    }

    /// Repacks the weights of these layers for the backward pass.
    pub fn cut_backward(&mut self, linears: impl IntoIterator<Item = Linear>, parameters: &[f32]) {
        self.cut(linears, |linear, panels| panels.cut(linear.weight(parameters), linear.inputs));
    }
}

impl Linear {
    /// `y = x W^T + b`; `weights` in panels for the forward pass.
    pub fn forward(&self, parameters: &[f32], weights: &CutWeights, x: &[f32], y: &mut [f32]) {
        product(x, &weights.0[self.index], self.bias(parameters), Then::Store, y);
    }

    /// `y = max(x W^T + b, 0)`.
    pub fn forward_rectified(&self, parameters: &[f32], weights: &CutWeights, x: &[f32], y: &mut [f32]) {
        product(x, &weights.0[self.index], self.bias(parameters), Then::Rectify, y);
    }

    /// `y += x W^T`, without the bias.
    pub fn add_forward(&self, weights: &CutWeights, x: &[f32], y: &mut [f32]) {
        product(x, &weights.0[self.index], &[], Then::Add, y);
    }

    /// `dx = dy W`; `weights` in panels for the backward pass.
    pub fn backward_input(&self, weights: &CutWeights, dy: &[f32], dx: &mut [f32]) {
        product(dy, &weights.0[self.index], &[], Then::Store, dx);
    }

    /// `dx += dy W`.
    pub fn add_backward_input(&self, weights: &CutWeights, dy: &[f32], dx: &mut [f32]) {
        product(dy, &weights.0[self.index], &[], Then::Add, dx);
    }

    /// `dW += dy^T x` and `db += ` the sum of the rows of `dy`; `panels` is scratch.
    pub fn backward_parameters(&self, x: &[f32], dy: &[f32], panels: &mut Panels, gradients: &mut [f32]) {
        let (weight, bias) = self.split_mut(gradients);
        panels.cut(x, self.inputs);
        add_transposed_product(dy, self.outputs, panels, weight);
        if self.biased {
            add_rows(dy, bias);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix of small integers, whose sums are exact in any order.
    fn whole(rows: usize, columns: usize, step: usize) -> Vec<f32> {
        (0..rows * columns).map(|index| (index * step % 15) as f32 - 7.0).collect()
    }

    /// All remainders: rows beyond a tile, columns beyond a panel.
    const SIZES: [(usize, usize, usize); 5] = [(1, 1, 1), (7, 3, 5), (6, 16, 16), (13, 4, 33), (25, 19, 70)];

    #[test]
    fn products_are_exact_on_whole_numbers() {
        for (rows, inner, columns) in SIZES {
            let (a, w) = (whole(rows, inner, 7), whole(columns, inner, 11));
            let (bias, before) = (whole(1, columns, 4), whole(rows, columns, 2));
            let mut panels = Panels::default();
            panels.cut_transposed(&w, inner);
            for then in [Then::Store, Then::Add, Then::Rectify] {
                let (mut fast, mut portable) = (before.clone(), before.clone());
                product(&a, &panels, &bias, then, &mut fast);
                product_body::<false>(&a, &panels, &bias, then, &mut portable);
                assert_eq!(fast, portable);
                for (index, found) in fast.into_iter().enumerate() {
                    let (row, column) = (index / columns, index % columns);
                    let terms = (0..inner).map(|k| a[row * inner + k] * w[column * inner + k]);
                    let value = bias[column] + terms.sum::<f32>();
                    let expected = match then {
                        Then::Store => value,
                        Then::Add => before[index] + value,
                        Then::Rectify => value.max(0.0),
                    };
                    assert_eq!(found, expected, "{rows} x {inner} x {columns} at {row}, {column}");
                }
            }
        }
    }

    #[test]
    fn transposed_products_are_exact_on_whole_numbers() {
        for (inner, rows, columns) in SIZES {
            let (a, b, before) = (whole(inner, rows, 7), whole(inner, columns, 11), whole(rows, columns, 2));
            let mut panels = Panels::default();
            panels.cut(&b, columns);
            let (mut fast, mut portable) = (before.clone(), before.clone());
            add_transposed_product(&a, rows, &panels, &mut fast);
            add_transposed_product_body::<false>(&a, rows, &panels, &mut portable);
            assert_eq!(fast, portable);
            for (index, found) in fast.into_iter().enumerate() {
                let (row, column) = (index / columns, index % columns);
                let terms = (0..inner).map(|k| a[k * rows + row] * b[k * columns + column]);
                assert_eq!(found, before[index] + terms.sum::<f32>(), "{inner} x {rows} x {columns}");
            }
        }
    }
}
