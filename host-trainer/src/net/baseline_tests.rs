//! Properties of the paper's baseline networks.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

fn number(rng: &mut ChaCha8Rng) -> f32 {
    2.0 * rng.random::<f32>() - 1.0
}

fn preferences(rng: &mut ChaCha8Rng, count: usize) -> Vec<[f32; 2]> {
    (0..count).map(|_| [number(rng), number(rng)]).collect()
}

/// One state for each count, under that number of preferences.
trait Drawn: Architecture {
    fn draw(rng: &mut ChaCha8Rng, copies: &[usize]) -> Self::Batch;
}

impl Drawn for MapShape {
    fn draw(rng: &mut ChaCha8Rng, copies: &[usize]) -> MapBatch {
        let mut batch = MapBatch::default();
        for &count in copies {
            let preferences = preferences(rng, count);
            let (local, global) = batch.push(number(rng), &preferences);
            local.fill_with(|| number(rng));
            global.fill_with(|| number(rng));
        }
        batch
    }
}

impl Drawn for VectorShape {
    fn draw(rng: &mut ChaCha8Rng, copies: &[usize]) -> VectorBatch {
        let mut batch = VectorBatch::default();
        for &count in copies {
            let preferences = preferences(rng, count);
            batch.push(&std::array::from_fn(|_| number(rng)), &preferences);
        }
        batch
    }
}

/// A smooth loss, summed in `f64`: sum of weight * output + output^2 / 2.
fn loss(outputs: &[f32], weights: &[f32]) -> f64 {
    let terms = outputs.iter().zip(weights);
    terms.map(|(&o, &w)| f64::from(o) * f64::from(w) + 0.5 * f64::from(o).powi(2)).sum()
}

/// Each tensor's gradient: along its own direction, and some of its entries.
fn agrees_with_finite_differences<N: Drawn>(copies: &[usize]) {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let network = N::with_outputs(10);
    let parameters = network.initialise(&mut rng);
    let batch = N::draw(&mut rng, copies);
    let samples: usize = copies.iter().sum();
    let weights: Vec<f32> = (0..samples * 10).map(|_| number(&mut rng)).collect();
    let mut workspace = N::Workspace::default();
    let mut gradients = vec![0.0; parameters.len()];
    let slope = |range: Range<usize>, outputs: &[f32], d: &mut [f32]| {
        for ((d, output), weight) in d.iter_mut().zip(outputs).zip(&weights[range.start * 10..]) {
            *d = output + weight;
        }
    };
    network.forward_backward(&parameters, &batch, &mut workspace, slope, &mut gradients);
    let mut loss_at = |moved: &[f32]| loss(network.forward(moved, &batch, &mut workspace), &weights);
    for tensor in network.tensors() {
        let gradient = tensor.of(&gradients);
        let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        let mut shifted = |h: f64| {
            let mut moved = parameters.clone();
            for (p, g) in moved[tensor.offset..].iter_mut().zip(gradient) {
                *p += (h * f64::from(*g) / norm) as f32;
            }
            loss_at(&moved)
        };
        // Small, because ReLU is not differentiable at 0. `tests/pytorch_fixture.rs` tests more sharply.
        let measured = (shifted(3e-4) - shifted(-3e-4)) / 6e-4;
        assert!((measured - norm).abs() < 1e-2 * norm + 2e-3, "{}: {measured}, {norm}", tensor.name);
        let largest = gradient.iter().map(|g| f64::from(g.abs())).fold(0.0, f64::max);
        for _ in 0..4 {
            let index = tensor.offset + rng.random_range(0..tensor.len());
            let mut at = |h: f32| {
                let mut moved = parameters.clone();
                moved[index] += h;
                loss_at(&moved)
            };
            let measured = (at(1e-3) - at(-1e-3)) / 2e-3;
            let found = f64::from(gradients[index]);
            assert!(
                (measured - found).abs() < 0.03 * largest + 2e-3,
                "{} {index}: {measured}, {found}",
                tensor.name
            );
        }
    }
}

#[test]
fn gradients_on_maps_agree_with_finite_differences() {
    agrees_with_finite_differences::<MapShape>(&[1, 3, 0, 2, 1, 1, 1, 1, 1, 2]);
}

#[test]
fn gradients_on_vectors_agree_with_finite_differences() {
    agrees_with_finite_differences::<VectorShape>(&[1, 3, 0, 2]);
}

/// Several preferences for one state give the same outputs as each alone.
fn copies_share_only_work<N: Drawn>(push: impl Fn(&mut N::Batch, &mut ChaCha8Rng, &[[f32; 2]])) {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let network = N::with_outputs(5);
    let parameters = network.initialise(&mut rng);
    let wanted = preferences(&mut rng, 4);
    let mut workspace = N::Workspace::default();
    let mut batch = N::Batch::default();
    push(&mut batch, &mut rng.clone(), &wanted);
    let together = network.forward(&parameters, &batch, &mut workspace).to_vec();
    for (preference, together) in wanted.iter().zip(together.chunks(5)) {
        batch.clear();
        push(&mut batch, &mut rng.clone(), &[*preference]);
        let alone = network.forward(&parameters, &batch, &mut workspace);
        for (alone, together) in alone.iter().zip(together) {
            assert!((alone - together).abs() < 1e-5, "{alone} {together}");
        }
    }
}

#[test]
fn a_state_under_many_preferences_is_what_it_is_under_each() {
    copies_share_only_work::<MapShape>(|batch, rng, preferences| {
        let (local, global) = batch.push(0.5, preferences);
        local.fill_with(|| number(rng));
        global.fill_with(|| number(rng));
    });
    copies_share_only_work::<VectorShape>(|batch, rng, preferences| {
        batch.push(&std::array::from_fn(|_| number(rng)), preferences);
    });
}

#[test]
fn tensors_fill_the_flat_vector_with_documented_counts() {
    fn check<N: Architecture>(outputs: usize, count: usize) {
        let network = N::with_outputs(outputs);
        let mut next = 0;
        for tensor in network.tensors() {
            assert_eq!(tensor.offset, next, "{}", tensor.name);
            next += tensor.len();
        }
        assert_eq!((network.parameter_count(), next), (count, count));
        assert_eq!(network.initialise(&mut ChaCha8Rng::seed_from_u64(1)).len(), count);
    }
    check::<Shape>(5, 89_989);
    check::<MapShape>(5, 186_565);
    check::<MapShape>(10, 187_850);
    check::<VectorShape>(5, 84_229);
}
