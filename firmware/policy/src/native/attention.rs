//! Multi-head attention of one block of tokens towards all tokens present.

use super::kernel::add_product;
use super::shape::{BLOCKS, Block, HEAD_WIDTH, HEADS, LANES, PANEL, WIDTH};
use crate::{Attention, TOKENS};

/// Weights of one head for the queries of one block: `[key block][key lane][query lane]`.
pub(super) type Weights = [[[f32; LANES]; LANES]; BLOCKS];

/// Keys, then values of one block.
pub(super) type KeyValue = Block<{ 2 * WIDTH }>;

/// Softmax(q k^T) v for each head and each query of a block. The query is already divided by the root of the head's
/// width.
///
/// `weights` is scratch memory. `observe` receives the weights of each head.
///
/// # Cost
/// `2 WIDTH` multiply-adds and [`HEADS`] exponentials for each pair of a query and a key.
pub(super) fn attend(
    query: &Block<WIDTH>,
    key_value: &[KeyValue; BLOCKS],
    tokens: usize,
    weights: &mut Weights,
    mixed: &mut Block<WIDTH>,
    mut observe: impl FnMut(&Weights),
) {
    let (query, _) = query.as_chunks::<HEAD_WIDTH>();
    let (mixed, _) = mixed.as_chunks_mut::<HEAD_WIDTH>();
    for (head, (query, mixed)) in (0..HEADS).zip(query.iter().zip(mixed)) {
        for (weights, block) in weights.iter_mut().zip(key_value).take(blocks(tokens)) {
            *weights = scores(query, part(block, head));
        }
        softmax(weights, tokens);
        observe(weights);
        mix(weights, key_value, HEADS + head, tokens, mixed);
    }
}

/// Blocks of `tokens` tokens.
pub(super) fn blocks(tokens: usize) -> usize {
    tokens.div_ceil(LANES)
}

/// The rows of one head: the keys for `head` below [`HEADS`], then the values.
fn part(block: &KeyValue, head: usize) -> &[[f32; LANES]; HEAD_WIDTH] {
    const NONE: [[f32; LANES]; HEAD_WIDTH] = [[0.0; LANES]; HEAD_WIDTH];
    let (parts, _) = block.as_chunks::<HEAD_WIDTH>();
    parts.get(head).unwrap_or(&NONE)
}

fn scores(query: &[[f32; LANES]; HEAD_WIDTH], key: &[[f32; LANES]; HEAD_WIDTH]) -> [[f32; LANES]; LANES] {
    let mut sums = [[0.0; LANES]; LANES];
    for (query, key) in query.iter().zip(key) {
        add_product(&mut sums, *key, query);
    }
    sums
}

/// Softmax over the keys, for each query. Lanes without a token get weight 0.
fn softmax(weights: &mut Weights, tokens: usize) {
    let keys = weights.as_flattened_mut();
    let mut largest = [f32::MIN; LANES];
    for key in keys.iter().take(tokens) {
        for (score, largest) in key.iter().zip(&mut largest) {
            *largest = if *score > *largest { *score } else { *largest };
        }
    }
    let mut sum = [0.0; LANES];
    for key in keys.iter_mut().take(tokens) {
        for ((score, largest), sum) in key.iter_mut().zip(largest).zip(&mut sum) {
            *score = libm::expf(*score - largest);
            *sum += *score;
        }
    }
    let inverse = sum.map(|sum| 1.0 / sum);
    for key in keys.iter_mut().take(tokens) {
        for (weight, inverse) in key.iter_mut().zip(inverse) {
            *weight *= inverse;
        }
    }
    for key in keys.iter_mut().skip(tokens) {
        *key = [0.0; LANES];
    }
}

/// The weighted sum of one head's values.
fn mix(
    weights: &Weights,
    key_value: &[KeyValue; BLOCKS],
    part_of_values: usize,
    tokens: usize,
    mixed: &mut [[f32; LANES]; HEAD_WIDTH],
) {
    let (mixed, _) = mixed.as_chunks_mut::<PANEL>();
    for (features, mixed) in (0..HEAD_WIDTH / PANEL).zip(mixed) {
        let mut sums = [[0.0; LANES]; PANEL];
        for (weights, block) in weights.iter().zip(key_value).take(blocks(tokens)) {
            let (values, _) = part(block, part_of_values).as_chunks::<PANEL>();
            let Some([a, b, c, d]) = values.get(features) else { continue };
            for ((((weights, &a), &b), &c), &d) in weights.iter().zip(a).zip(b).zip(c).zip(d) {
                add_product(&mut sums, [a, b, c, d], weights);
            }
        }
        *mixed = sums;
    }
}

/// Adds one head's weights, for the queries of block `block`, to the mean over the heads.
pub(super) fn add_mean(attention: &mut Attention, block: usize, tokens: usize, weights: &Weights) {
    let keys = weights.as_flattened();
    let rows = attention.0.iter_mut().take(tokens).skip(block.saturating_mul(LANES)).take(LANES);
    for (lane, row) in (0..LANES).zip(rows) {
        for (mean, key) in row.iter_mut().zip(keys).take(tokens.min(TOKENS)) {
            *mean += key.get(lane).copied().unwrap_or(0.0) * (1.0 / HEADS as f32);
        }
    }
}
