//! Multi-head attention of one observation on vector registers.
#![expect(
    clippy::indexing_slicing,
    reason = "constant indices below constant lengths, in loops that must unroll"
)]

use super::QKV;
use super::exponential::exp;
use crate::native::shape::{HEAD_WIDTH, HEADS, WIDTH};
use crate::{Attention, TOKENS};
use core::array;
use pulp::{Simd, WithSimd};

/// Queries in one row of scores: [`TOKENS`] rounded up to whole registers. [`HEAD_WIDTH`] is the same number.
const QUERIES: usize = TOKENS.next_multiple_of(HEAD_WIDTH);
/// Keys, and rows of the result, that are computed together.
const KEYS: usize = 4;

const _: () = assert!(QUERIES == HEAD_WIDTH, "vectors of queries and of features have the same number");

/// Memory that the attention reuses.
pub(super) struct Scratch {
    /// Queries by feature: `[WIDTH][QUERIES]`.
    queries: [f32; WIDTH * QUERIES],
    /// Scores, then weights, of one head: `[keys][queries]`.
    scores: [f32; QUERIES * QUERIES],
}

impl Scratch {
    pub const fn new() -> Scratch {
        Scratch { queries: [0.0; WIDTH * QUERIES], scores: [0.0; QUERIES * QUERIES] }
    }
}

/// `mixed = softmax(q k^T) v` for each head; the queries are already divided by the root of the head's width.
///
/// Softmax runs over the keys, which are rows of the scores, so no operation crosses the lanes of a register. Lanes
/// beyond `tokens` hold arbitrary numbers that no result uses.
pub(super) struct Attend<'a> {
    /// Query, key and value of each token: `[tokens][QKV]`, or longer.
    pub qkv: &'a [f32],
    /// `[tokens][WIDTH]` and at least three rows more, which are overwritten.
    pub mixed: &'a mut [f32],
    pub tokens: usize,
    pub scratch: &'a mut Scratch,
    /// Receives the mean over the heads.
    pub explain: Option<&'a mut Attention>,
}

impl WithSimd for Attend<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F32_LANES {
            4 => self.run::<S, 4>(simd),
            8 => self.run::<S, 2>(simd),
            16 => self.run::<S, 1>(simd),
            _ => {}
        }
    }
}

impl Attend<'_> {
    /// `VECTORS` registers hold [`QUERIES`] numbers.
    #[inline(always)]
    fn run<S: Simd, const VECTORS: usize>(mut self, simd: S) {
        let tokens = self.tokens.min(TOKENS);
        for (token, row) in self.qkv.chunks_exact(QKV).take(tokens).enumerate() {
            for (feature, number) in row[..WIDTH].iter().enumerate() {
                self.scratch.queries[feature * QUERIES + token] = *number;
            }
        }
        for head in 0..HEADS {
            self.score::<S, VECTORS>(simd, tokens, head);
            let (weights, _) = S::as_mut_simd_f32s(&mut self.scratch.scores);
            softmax(simd, &mut weights.as_chunks_mut::<VECTORS>().0[..tokens]);
            self.mix::<S, VECTORS>(simd, tokens, head);
            self.explain(tokens);
        }
    }

    #[inline(always)]
    fn score<S: Simd, const VECTORS: usize>(&mut self, simd: S, tokens: usize, head: usize) {
        let queries = &self.scratch.queries[head * HEAD_WIDTH * QUERIES..][..HEAD_WIDTH * QUERIES];
        let (queries, _) = S::as_simd_f32s(queries);
        let (queries, _) = queries.as_chunks::<VECTORS>();
        let (scores, _) = S::as_mut_simd_f32s(&mut self.scratch.scores);
        let (scores, _) = scores.as_chunks_mut::<VECTORS>();
        for first in (0..tokens).step_by(KEYS) {
            let keys: [&[f32]; KEYS] = array::from_fn(|key| {
                &self.qkv[(first + key).min(tokens - 1) * QKV + WIDTH + head * HEAD_WIDTH..][..HEAD_WIDTH]
            });
            let mut sums = [[simd.splat_f32s(0.0); VECTORS]; KEYS];
            for (feature, query) in queries.iter().enumerate() {
                for key in 0..KEYS {
                    let number = simd.splat_f32s(keys[key][feature]);
                    for vector in 0..VECTORS {
                        let product = simd.mul_f32s(query[vector], number);
                        sums[key][vector] = simd.add_f32s(sums[key][vector], product);
                    }
                }
            }
            scores[first..first + KEYS].copy_from_slice(&sums);
        }
    }

    #[inline(always)]
    fn mix<S: Simd, const VECTORS: usize>(&mut self, simd: S, tokens: usize, head: usize) {
        for first in (0..tokens).step_by(KEYS) {
            let mut sums = [[simd.splat_f32s(0.0); VECTORS]; KEYS];
            let (weights, _) = self.scratch.scores.as_chunks::<QUERIES>();
            for (row, weights) in self.qkv.chunks_exact(QKV).zip(weights).take(tokens) {
                let (values, _) = S::as_simd_f32s(&row[2 * WIDTH + head * HEAD_WIDTH..][..HEAD_WIDTH]);
                for query in 0..KEYS {
                    let weight = simd.splat_f32s(weights[first + query]);
                    for vector in 0..VECTORS {
                        let product = simd.mul_f32s(values[vector], weight);
                        sums[query][vector] = simd.add_f32s(sums[query][vector], product);
                    }
                }
            }
            for (query, sums) in sums.iter().enumerate() {
                let place = &mut self.mixed[(first + query) * WIDTH + head * HEAD_WIDTH..][..HEAD_WIDTH];
                S::as_mut_simd_f32s(place).0.copy_from_slice(sums);
            }
        }
    }

    /// Adds one head's weights to the mean over the heads.
    fn explain(&mut self, tokens: usize) {
        let Some(attention) = self.explain.as_deref_mut() else { return };
        let (weights, _) = self.scratch.scores.as_chunks::<QUERIES>();
        for (query, row) in attention.0.iter_mut().enumerate().take(tokens) {
            for (mean, weights) in row.iter_mut().zip(weights).take(tokens) {
                *mean += weights[query] * (1.0 / HEADS as f32);
            }
        }
    }
}

/// Softmax over the rows, in place.
#[inline(always)]
fn softmax<S: Simd, const VECTORS: usize>(simd: S, rows: &mut [[S::f32s; VECTORS]]) {
    let mut largest = [simd.splat_f32s(f32::MIN); VECTORS];
    for row in rows.iter() {
        for vector in 0..VECTORS {
            largest[vector] = simd.max_f32s(largest[vector], row[vector]);
        }
    }
    let mut sums = [simd.splat_f32s(0.0); VECTORS];
    for row in rows.iter_mut() {
        for vector in 0..VECTORS {
            row[vector] = exp(simd, simd.sub_f32s(row[vector], largest[vector]));
            sums[vector] = simd.add_f32s(sums[vector], row[vector]);
        }
    }
    let inverse = sums.map(|sum| simd.div_f32s(simd.splat_f32s(1.0), sum));
    for row in rows.iter_mut() {
        for vector in 0..VECTORS {
            row[vector] = simd.mul_f32s(row[vector], inverse[vector]);
        }
    }
}
