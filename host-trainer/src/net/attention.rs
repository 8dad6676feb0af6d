//! Multi-head attention among the tokens of each sample, forward and backward.
//!
//! The tokens of a sample are scattered rows of the chunk's matrices (see [`super::workspace::Tokens`]). A sample has at
//! most 15 tokens, so one row of scores fits into one [`Lanes`]; the unused lanes hold probability 0.

use super::lanes::{LANES, Lanes, vectorised};
use super::shape::{HEAD_WIDTH, WIDTH};
use super::workspace::{KEPT, Tokens};

/// Numbers of one row of `q | k | v`.
const QKV: usize = 3 * WIDTH;
/// 1 / sqrt(16).
const SCALE: f32 = 0.25;
const _: () = assert!(HEAD_WIDTH == LANES && HEAD_WIDTH == 16);

/// The sixteen numbers of `part` (0 query, 1 key, 2 value) of one head and one token.
#[inline(always)]
fn head_of(qkv: &[f32], row: u32, part: usize, head: usize) -> Lanes {
    let start = row as usize * QKV + part * WIDTH + head * HEAD_WIDTH;
    Lanes::load(&qkv[start..])
}

/// One part of a head, transposed: lane `j` of entry `c` is number `c` of token `j`.
#[inline(always)]
fn columns_of(qkv: &[f32], rows: &[u32], part: usize, head: usize) -> [Lanes; HEAD_WIDTH] {
    let mut columns = [Lanes::ZERO; HEAD_WIDTH];
    for (j, &row) in rows.iter().enumerate().take(LANES) {
        let lanes = head_of(qkv, row, part, head);
        for (column, &number) in columns.iter_mut().zip(&lanes.0) {
            column.0[j] = number;
        }
    }
    columns
}

/// `sum over c of weights[c] * columns[c]`.
#[inline(always)]
fn combine<const FUSED: bool>(weights: Lanes, columns: &[Lanes; HEAD_WIDTH]) -> Lanes {
    let mut sum = Lanes::ZERO;
    for (weight, column) in weights.0.iter().zip(columns) {
        sum = Lanes::splat(*weight).mul_add::<FUSED>(*column, sum);
    }
    sum
}

/// 0 for the first `tokens` lanes, minus infinity for the others.
#[inline(always)]
fn mask(tokens: usize) -> Lanes {
    let mut mask = Lanes::splat(f32::NEG_INFINITY);
    mask.0[..tokens].fill(0.0);
    mask
}

#[inline(always)]
fn softmax<const FUSED: bool>(scores: Lanes) -> Lanes {
    let exponentials = scores.sub(Lanes::splat(scores.largest())).exp::<FUSED>();
    exponentials.mul(Lanes::splat(1.0 / exponentials.sum()))
}

#[inline(always)]
fn attend_body<const FUSED: bool>(
    tokens: &Tokens,
    qkv: &[f32],
    probabilities: &mut [f32],
    mixed: &mut [f32],
) {
    for (start, rows) in tokens.samples() {
        let mask = mask(rows.len());
        let kept = &mut probabilities[start * KEPT..(start + rows.len()) * KEPT];
        for (head, kept) in kept.chunks_exact_mut(rows.len() * LANES).enumerate() {
            let keys = columns_of(qkv, rows, 1, head);
            let mut values = [Lanes::ZERO; LANES];
            for (value, &row) in values.iter_mut().zip(rows) {
                *value = head_of(qkv, row, 2, head);
            }
            for (&row, kept) in rows.iter().zip(kept.chunks_exact_mut(LANES)) {
                let query = head_of(qkv, row, 0, head).mul(Lanes::splat(SCALE));
                let row_of = softmax::<FUSED>(combine::<FUSED>(query, &keys).add(mask));
                row_of.store(kept);
                let mut sum = Lanes::ZERO;
                for (value, &p) in values.iter().zip(&row_of.0).take(rows.len()) {
                    sum = Lanes::splat(p).mul_add::<FUSED>(*value, sum);
                }
                sum.store(&mut mixed[row as usize * WIDTH + head * HEAD_WIDTH..]);
            }
        }
    }
}

#[inline(always)]
fn attend_backward_body<const FUSED: bool>(
    tokens: &Tokens,
    qkv: &[f32],
    probabilities: &[f32],
    d_mixed: &[f32],
    d_qkv: &mut [f32],
) {
    for (start, rows) in tokens.samples() {
        let kept = &probabilities[start * KEPT..(start + rows.len()) * KEPT];
        for (head, kept) in kept.chunks_exact(rows.len() * LANES).enumerate() {
            let values = columns_of(qkv, rows, 2, head);
            let mut keys = [Lanes::ZERO; LANES];
            for (key, &row) in keys.iter_mut().zip(rows) {
                *key = head_of(qkv, row, 1, head);
            }
            let mut d_keys = [Lanes::ZERO; LANES];
            let mut d_values = [Lanes::ZERO; LANES];
            for (&row, kept) in rows.iter().zip(kept.chunks_exact(LANES)) {
                let at = row as usize;
                let d_out = Lanes::load(&d_mixed[at * WIDTH + head * HEAD_WIDTH..]);
                let p = Lanes::load(kept);
                let d_p = combine::<FUSED>(d_out, &values);
                let mean = p.mul(d_p).sum();
                let d_score = p.mul(d_p.sub(Lanes::splat(mean))).mul(Lanes::splat(SCALE));
                let query = head_of(qkv, row, 0, head);
                let mut d_query = Lanes::ZERO;
                for j in 0..rows.len().min(LANES) {
                    let d = Lanes::splat(d_score.0[j]);
                    d_query = d.mul_add::<FUSED>(keys[j], d_query);
                    d_keys[j] = d.mul_add::<FUSED>(query, d_keys[j]);
                    d_values[j] = Lanes::splat(p.0[j]).mul_add::<FUSED>(d_out, d_values[j]);
                }
                d_query.store(&mut d_qkv[at * QKV + head * HEAD_WIDTH..]);
            }
            for (j, &row) in rows.iter().enumerate().take(LANES) {
                let start = row as usize * QKV + WIDTH + head * HEAD_WIDTH;
                d_keys[j].store(&mut d_qkv[start..]);
                d_values[j].store(&mut d_qkv[start + WIDTH..]);
            }
        }
    }
}

vectorised! {
    /// Softmax(q k^T / 4) v for each sample and head.
    ///
    /// `qkv` is `[tokens, 3 WIDTH]`. `mixed` receives `[tokens, WIDTH]`, head by head; `probabilities` receives
    /// `[HEADS, tokens of the sample, LANES]` for each sample.
    pub(super) fn attend(
        tokens: &Tokens,
        qkv: &[f32],
        probabilities: &mut [f32],
        mixed: &mut [f32],
    ) = attend_body
}

vectorised! {
    /// Writes the gradient with respect to `qkv` to `d_qkv`, from `d_mixed`, that with respect to the result.
    pub(super) fn attend_backward(
        tokens: &Tokens,
        qkv: &[f32],
        probabilities: &[f32],
        d_mixed: &[f32],
        d_qkv: &mut [f32],
    ) = attend_backward_body
}
