//! Properties that need no external reference.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const SEED: u64 = 7;

fn random_sample(rng: &mut ChaCha8Rng, devices: usize) -> Sample {
    let mut number = || 2.0 * rng.random::<f32>() - 1.0;
    let mut sample = Sample { device_count: devices as u8, ..Sample::default() };
    sample.uav.fill_with(&mut number);
    sample.preference.fill_with(&mut number);
    sample.local_map.fill_with(&mut number);
    sample.devices[..devices].as_flattened_mut().fill_with(&mut number);
    sample
}

fn random_batch(rng: &mut ChaCha8Rng, device_counts: &[usize]) -> Batch {
    let mut batch = Batch::new();
    for &count in device_counts {
        batch.push_sample(&random_sample(rng, count));
    }
    batch
}

/// Parameters with random gains and biases of the norms, so that no gradient is a special case.
fn random_parameters(rng: &mut ChaCha8Rng, shape: Shape) -> Vec<f32> {
    let mut parameters = shape.initialise(rng);
    for tensor in shape.tensors().iter().filter(|tensor| tensor.name.contains("norm")) {
        for value in &mut parameters[tensor.offset..tensor.offset + tensor.len()] {
            *value += 0.3 * (2.0 * rng.random::<f32>() - 1.0);
        }
    }
    parameters
}

/// A smooth loss, summed in `f64`: sum of weight * output + output^2 / 2.
fn loss(outputs: &[f32], weights: &[f32]) -> f64 {
    let terms = outputs.iter().zip(weights);
    terms.map(|(&o, &w)| f64::from(o) * f64::from(w) + 0.5 * f64::from(o).powi(2)).sum()
}

/// Checks each tensor's gradient along its own direction: for small `h`,
/// `(loss(p + h d) - loss(p - h d)) / 2 h = |g|` with `d = g / |g|`.
#[test]
fn gradients_agree_with_finite_differences() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let small = Shape { feed_forward: 32, head: 16, outputs: 3, ..Shape::actor() };
    for shape in [small, Shape::critic()] {
        let parameters = random_parameters(&mut rng, shape);
        let batch = random_batch(&mut rng, &[0, 1, 3, 12, 6, 0]);
        let weights: Vec<f32> =
            (0..batch.len() * shape.outputs).map(|_| 2.0 * rng.random::<f32>() - 1.0).collect();
        let mut workspace = Workspace::new();
        let outputs = forward(&shape, &parameters, &batch, &mut workspace);
        let d_outputs: Vec<f32> = outputs.iter().zip(&weights).map(|(o, w)| o + w).collect();
        let mut gradients = vec![0.0; parameters.len()];
        backward(&shape, &parameters, &batch, &mut workspace, &d_outputs, &mut gradients);

        for tensor in shape.tensors() {
            let gradient = tensor.of(&gradients);
            let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
            let mut shifted = |h: f64| {
                let mut moved = parameters.clone();
                for (p, g) in moved[tensor.offset..].iter_mut().zip(gradient) {
                    *p += (h * f64::from(*g) / norm) as f32;
                }
                loss(forward(&shape, &moved, &batch, &mut workspace), &weights)
            };
            // ReLU and maximum are not differentiable everywhere, so a long step is inexact; a short one is dominated by
            // rounding. `tests/pytorch_fixture.rs` tests more sharply.
            let measured = [5e-4, 1e-4].map(|h| (shifted(h) - shifted(-h)) / (2.0 * h));
            let tolerance = 5e-3 * norm + 1e-3;
            let agrees = measured.iter().any(|measured| (measured - norm).abs() < tolerance);
            assert!(agrees, "{}: {measured:?} by differences, {norm}", tensor.name);
        }
    }
}

/// Some entries of the gradient alone: a wrong direction can have the right norm.
#[test]
fn single_gradients_agree_with_finite_differences() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED + 1);
    let shape = Shape { feed_forward: 32, head: 16, outputs: 3, ..Shape::actor() };
    let parameters = random_parameters(&mut rng, shape);
    let batch = random_batch(&mut rng, &[2, 0, 5]);
    let weights = vec![0.5; batch.len() * shape.outputs];
    let mut workspace = Workspace::new();
    let outputs = forward(&shape, &parameters, &batch, &mut workspace);
    let d_outputs: Vec<f32> = outputs.iter().zip(&weights).map(|(o, w)| o + w).collect();
    let mut gradients = vec![0.0; parameters.len()];
    backward(&shape, &parameters, &batch, &mut workspace, &d_outputs, &mut gradients);
    let scale = gradients.iter().map(|g| f64::from(g.abs())).fold(0.0, f64::max);
    for tensor in shape.tensors() {
        for _ in 0..6 {
            let index = tensor.offset + rng.random_range(0..tensor.len());
            let mut at = |h: f32| {
                let mut moved = parameters.clone();
                moved[index] += h;
                loss(forward(&shape, &moved, &batch, &mut workspace), &weights)
            };
            let h = 2e-3;
            let measured = (at(h) - at(-h)) / (2.0 * f64::from(h));
            let error = (measured - f64::from(gradients[index])).abs();
            let name = &tensor.name;
            let found = gradients[index];
            assert!(error < 1e-3 * scale, "{name} {index}: {measured} by differences, {found}");
        }
    }
}

#[test]
fn order_of_devices_does_not_matter() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let shape = Shape::actor();
    let parameters = random_parameters(&mut rng, shape);
    let sample = random_sample(&mut rng, 9);
    let mut turned = sample;
    turned.devices[..9].rotate_left(4);
    turned.devices.swap(0, 7);
    let mut batch = Batch::new();
    batch.push_sample(&sample);
    batch.push_sample(&turned);
    let mut workspace = Workspace::new();
    let outputs = forward(&shape, &parameters, &batch, &mut workspace);
    for (one, other) in outputs[..5].iter().zip(&outputs[5..]) {
        assert!((one - other).abs() < 1e-5, "{one} {other}");
    }
}

#[test]
fn a_sample_does_not_feel_its_neighbours() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let shape = Shape::critic();
    let parameters = random_parameters(&mut rng, shape);
    let counts: Vec<usize> = (0..37).map(|i| (i * 5) % 13).collect();
    let samples: Vec<Sample> = counts.iter().map(|&c| random_sample(&mut rng, c)).collect();
    let mut workspace = Workspace::new();
    let mut batch = Batch::new();
    samples.iter().for_each(|sample| batch.push_sample(sample));
    let together = forward(&shape, &parameters, &batch, &mut workspace).to_vec();
    for (sample, together) in samples.iter().zip(together.chunks(shape.outputs)) {
        batch.clear();
        batch.push_sample(sample);
        let alone = forward(&shape, &parameters, &batch, &mut workspace);
        for (alone, together) in alone.iter().zip(together) {
            assert!((alone - together).abs() < 1e-5, "{alone} {together}");
        }
    }
}

#[test]
fn in_one_go_gives_the_same_bits() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let shape = Shape::critic();
    let parameters = random_parameters(&mut rng, shape);
    let batch = random_batch(&mut rng, &[6; 40]);
    let mut workspace = Workspace::new();
    let d_outputs = forward(&shape, &parameters, &batch, &mut workspace).to_vec();
    let mut apart = vec![0.0; parameters.len()];
    backward(&shape, &parameters, &batch, &mut workspace, &d_outputs, &mut apart);
    let mut together = vec![0.0; parameters.len()];
    let mut seen = Vec::new();
    let square = |samples: std::ops::Range<usize>, outputs: &[f32], d: &mut [f32]| {
        seen.extend(samples);
        d.copy_from_slice(outputs);
    };
    forward_backward(&shape, &parameters, &batch, &mut workspace, square, &mut together);
    assert_eq!(seen, (0..40).collect::<Vec<_>>());
    assert_eq!(workspace.outputs(), d_outputs);
    assert_eq!(answer(&shape, &parameters, &batch, &mut workspace), d_outputs);
    assert!(apart.iter().zip(&together).all(|(a, b)| a.to_bits() == b.to_bits()));
}

#[test]
fn attention_rows_sum_to_one_where_present() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let shape = Shape::actor();
    let parameters = random_parameters(&mut rng, shape);
    let counts: Vec<usize> = (0..20).map(|i| i % 13).collect();
    let batch = random_batch(&mut rng, &counts);
    let mut workspace = Workspace::new();
    forward(&shape, &parameters, &batch, &mut workspace);
    for (sample, count) in counts.into_iter().enumerate() {
        let map = workspace.attention(sample);
        for (query, row) in map.iter().enumerate() {
            let sum: f32 = row.iter().sum();
            let expected = if query < FIXED_TOKENS + count { 1.0 } else { 0.0 };
            assert!((sum - expected).abs() < 1e-5, "sample {sample} query {query}: {sum}");
            assert!(row[FIXED_TOKENS + count..].iter().all(|&p| p == 0.0));
        }
    }
}

#[test]
fn adam_lowers_a_loss_and_polyak_follows() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let shape = Shape::actor();
    let mut parameters = shape.initialise(&mut rng);
    let mut slow = parameters.clone();
    let batch = random_batch(&mut rng, &[4, 2, 0, 7]);
    let mut adam = Adam::new(parameters.len(), 3e-4);
    let mut workspace = Workspace::new();
    let mut losses = Vec::new();
    for _ in 0..50 {
        let mut total = 0.0;
        let mut gradients = vec![0.0; parameters.len()];
        let towards_one = |_: std::ops::Range<usize>, outputs: &[f32], d: &mut [f32]| {
            for (d, output) in d.iter_mut().zip(outputs) {
                *d = output - 1.0;
                total += *d * *d;
            }
        };
        forward_backward(&shape, &parameters, &batch, &mut workspace, towards_one, &mut gradients);
        adam.step(&mut parameters, &gradients);
        let before = slow[0];
        polyak(&mut slow, &parameters, 0.25);
        assert!((slow[0] - (0.75 * before + 0.25 * parameters[0])).abs() < 1e-6);
        losses.push(total);
    }
    assert_eq!(adam.step, 50);
    assert!(losses[49] < 0.1 * losses[0], "{losses:?}");
}
