//! The networks against PyTorch: outputs, attention, losses, gradients and parameters after three steps of Adam.
//!
//! The frozen numbers come from `scripts/pytorch_fixture.py` and, for the networks of the paper's baselines, from
//! `scripts/pytorch_fixture_baselines.py`. Both scripts say how to run them. Parameters and inputs are drawn here by the
//! same generator.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use gleaner_host_trainer::net::{Adam, Batch, DEVICE_FEATURES, MAP_CELLS, Shape, TOKENS_MAX, Workspace};
use gleaner_host_trainer::net::{Architecture, MapBatch, MapShape, VectorBatch, VectorShape};
use gleaner_host_trainer::net::{GLOBAL_NUMBERS, LOCAL_NUMBERS, VECTOR_FEATURES, backward, forward};

#[derive(serde::Deserialize)]
struct Manifest {
    seed: String,
    #[serde(default)]
    device_counts: Vec<usize>,
    #[serde(default)]
    copies: Vec<usize>,
    steps: usize,
    learning_rate: f32,
    stride: usize,
    sections: BTreeMap<String, (usize, usize)>,
}

struct Fixture {
    manifest: Manifest,
    numbers: Vec<f32>,
}

impl Fixture {
    fn read(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
        let manifest = std::fs::read_to_string(folder.join(format!("{name}.json"))).unwrap();
        let bytes = std::fs::read(folder.join(format!("{name}.f32"))).unwrap();
        let number = |four: &[u8]| f32::from_le_bytes(four.try_into().unwrap());
        Self {
            manifest: serde_json::from_str(&manifest).unwrap(),
            numbers: bytes.chunks_exact(4).map(number).collect(),
        }
    }

    fn section(&self, network: &str, name: &str) -> &[f32] {
        let (start, len) = self.manifest.sections[&format!("{network}.{name}")];
        &self.numbers[start..start + len]
    }
}

/// xorshift64*: uniform in [-1, 1) in steps of 2^-23.
struct Generator(u64);

impl Generator {
    fn number(&mut self) -> f32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 40;
        (bits as f64 / f64::from(1 << 23) - 1.0) as f32
    }

    fn numbers(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| self.number()).collect()
    }

    fn parameters(&mut self, shape: Shape) -> Vec<f32> {
        let mut parameters = Vec::new();
        let mut inputs = 1.0;
        for tensor in shape.tensors() {
            let norm = tensor.name.contains("norm");
            let gain = norm && tensor.name.ends_with("weight");
            if tensor.name.ends_with("weight") {
                inputs = f64::from(tensor.cols as u32).sqrt();
            }
            for drawn in self.numbers(tensor.len()).into_iter().map(f64::from) {
                let value = if norm { drawn * 0.25 + f64::from(u8::from(gain)) } else { drawn / inputs };
                parameters.push(value as f32);
            }
        }
        parameters
    }

    fn batch<const MAP: usize, const DEVICE: usize>(&mut self, device_counts: &[usize]) -> Batch {
        let count = device_counts.len();
        let (uav, preference, local_map) =
            (self.numbers(count * 4), self.numbers(count * 2), self.numbers(count * MAP));
        let mut batch = Batch::new();
        for (sample, &present) in device_counts.iter().enumerate() {
            let devices = self.numbers(present * DEVICE);
            batch.push(
                uav[sample * 4..][..4].try_into().unwrap(),
                preference[sample * 2..][..2].try_into().unwrap(),
                local_map[sample * MAP..].first_chunk::<MAP>().unwrap(),
                devices.as_chunks::<DEVICE>().0,
            );
        }
        batch
    }
}

fn assert_close(what: &str, ours: &[f32], torch: &[f32], tolerance: f32) {
    assert_eq!(ours.len(), torch.len(), "{what}");
    for (index, (ours, torch)) in ours.iter().zip(torch).enumerate() {
        assert!((ours - torch).abs() <= tolerance, "{what} {index}: {ours}, PyTorch {torch}");
    }
}

/// The biases of the keys. They shift all scores of a query equally, so their gradient is 0, and Adam amplifies the
/// rounding errors.
fn key_biases(shape: Shape) -> Vec<Range<usize>> {
    let tensors = shape.tensors().into_iter().filter(|tensor| tensor.name.ends_with("qkv.bias"));
    tensors.map(|tensor| tensor.offset + 64..tensor.offset + 128).collect()
}

fn agrees_with_pytorch<const MAP: usize, const DEVICE: usize>(network: &str, shape: Shape) {
    let fixture = Fixture::read("pytorch");
    let manifest = &fixture.manifest;
    let mut generator = Generator(manifest.seed.parse().unwrap());
    let mut parameters = generator.parameters(shape);
    let batch = generator.batch::<MAP, DEVICE>(&manifest.device_counts);
    let targets = generator.numbers(batch.len() * shape.outputs);
    let strided = |all: &[f32]| all.iter().copied().step_by(manifest.stride).collect::<Vec<_>>();

    let mut workspace = Workspace::new();
    let mut adam = Adam::new(parameters.len(), manifest.learning_rate);
    let mut losses = Vec::new();
    for step in 0..manifest.steps {
        let outputs = forward(&shape, &parameters, &batch, &mut workspace);
        let scale = 1.0 / outputs.len() as f32;
        let differences: Vec<f32> = outputs.iter().zip(&targets).map(|(o, t)| o - t).collect();
        losses.push(scale * differences.iter().map(|d| d * d).sum::<f32>());
        let d_outputs: Vec<f32> = differences.iter().map(|d| 2.0 * scale * d).collect();
        let mut gradients = vec![0.0; parameters.len()];
        if step == 0 {
            assert_close("outputs", outputs, fixture.section(network, "outputs"), 5e-6);
            let maps = (0..batch.len()).flat_map(|s| workspace.attention(s).into_iter().flatten());
            let maps: Vec<f32> = maps.collect();
            assert_eq!(maps.len(), batch.len() * TOKENS_MAX * TOKENS_MAX);
            assert_close("attention", &maps, fixture.section(network, "attention"), 1e-6);
        }
        backward(&shape, &parameters, &batch, &mut workspace, &d_outputs, &mut gradients);
        if step == 0 {
            let square = |g: &f32| f64::from(*g).powi(2);
            let norm = |part: &[f32]| part.iter().map(square).sum::<f64>().sqrt() as f32;
            let norms: Vec<f32> = shape.tensors().iter().map(|t| norm(t.of(&gradients))).collect();
            assert_close("norms", &norms, fixture.section(network, "gradient_norms"), 2e-6);
            assert_close("gradients", &strided(&gradients), fixture.section(network, "gradients"), 5e-7);
        }
        adam.step(&mut parameters, &gradients);
    }
    assert_close("losses", &losses, fixture.section(network, "losses"), 1e-6);
    let mut after = strided(&parameters);
    let torch = fixture.section(network, "parameters_after");
    for index in key_biases(shape).into_iter().flatten().filter(|i| i % manifest.stride == 0) {
        after[index / manifest.stride] = torch[index / manifest.stride];
    }
    assert_close("parameters after", &after, torch, 2e-5);
}

#[test]
fn actor_agrees_with_pytorch() {
    agrees_with_pytorch::<MAP_CELLS, DEVICE_FEATURES>("actor", Shape::actor());
}

#[test]
fn critic_agrees_with_pytorch() {
    agrees_with_pytorch::<MAP_CELLS, DEVICE_FEATURES>("critic", Shape::critic());
}

#[test]
fn paper_actor_agrees_with_pytorch() {
    agrees_with_pytorch::<100, 5>("paper", Shape::paper(5));
}

/// `draw` packs the states. Preferences and targets are drawn after them.
fn baseline_agrees_with_pytorch<N: Architecture>(
    name: &str,
    network: N,
    draw: impl Fn(&mut Generator, &[usize]) -> N::Batch,
) {
    let fixture = Fixture::read("pytorch_baselines");
    let manifest = &fixture.manifest;
    let mut generator = Generator(manifest.seed.parse().unwrap());
    let mut parameters = Vec::new();
    let mut inputs = 1.0;
    for tensor in network.tensors() {
        if tensor.name.ends_with("weight") {
            inputs = f64::from(tensor.cols as u32).sqrt();
        }
        let drawn = generator.numbers(tensor.len());
        parameters.extend(drawn.into_iter().map(|number| (f64::from(number) / inputs) as f32));
    }
    let batch = draw(&mut generator, &manifest.copies);
    let outputs = network.outputs();
    let targets = generator.numbers(manifest.copies.iter().sum::<usize>() * outputs);
    let strided = |all: &[f32]| all.iter().copied().step_by(manifest.stride).collect::<Vec<_>>();

    let mut workspace = N::Workspace::default();
    let mut adam = Adam::new(parameters.len(), manifest.learning_rate);
    let scale = 1.0 / targets.len() as f32;
    let mut losses = Vec::new();
    for step in 0..manifest.steps {
        let mut gradients = vec![0.0; parameters.len()];
        let mut loss = 0.0;
        let squares = |samples: Range<usize>, found: &[f32], d: &mut [f32]| {
            for ((d, found), target) in d.iter_mut().zip(found).zip(&targets[samples.start * outputs..]) {
                loss += scale * (found - target).powi(2);
                *d = 2.0 * scale * (found - target);
            }
        };
        let found = network.forward_backward(&parameters, &batch, &mut workspace, squares, &mut gradients);
        if step == 0 {
            assert_close("outputs", found, fixture.section(name, "outputs"), 5e-6);
            let found = found.to_vec();
            assert_eq!(
                network.forward(&parameters, &batch, &mut workspace),
                found,
                "both ways the same bits"
            );
            let square = |g: &f32| f64::from(*g).powi(2);
            let norm = |part: &[f32]| part.iter().map(square).sum::<f64>().sqrt() as f32;
            let norms: Vec<f32> = network.tensors().iter().map(|t| norm(t.of(&gradients))).collect();
            assert_close("norms", &norms, fixture.section(name, "gradient_norms"), 2e-6);
            assert_close("gradients", &strided(&gradients), fixture.section(name, "gradients"), 5e-7);
        }
        losses.push(loss);
        adam.step(&mut parameters, &gradients);
    }
    assert_close("losses", &losses, fixture.section(name, "losses"), 1e-6);
    let torch = fixture.section(name, "parameters_after");
    assert_close("parameters after", &strided(&parameters), torch, 2e-5);
}

/// This number of preferences for each state, drawn for all states together.
fn preferences(generator: &mut Generator, copies: &[usize]) -> Vec<Vec<[f32; 2]>> {
    let all = generator.numbers(2 * copies.iter().sum::<usize>());
    let mut rest = all.as_chunks::<2>().0;
    let mut next = |&count: &usize| {
        let (own, others) = rest.split_at(count);
        rest = others;
        own.to_vec()
    };
    copies.iter().map(&mut next).collect()
}

#[test]
fn maps_agree_with_pytorch() {
    baseline_agrees_with_pytorch("maps", MapShape { outputs: 10 }, |generator, copies| {
        let local = generator.numbers(copies.len() * LOCAL_NUMBERS);
        let global = generator.numbers(copies.len() * GLOBAL_NUMBERS);
        let battery = generator.numbers(copies.len());
        let mut batch = MapBatch::default();
        for (state, preferences) in preferences(generator, copies).iter().enumerate() {
            let (own_local, own_global) = batch.push(battery[state], preferences);
            own_local.copy_from_slice(&local[state * LOCAL_NUMBERS..][..LOCAL_NUMBERS]);
            own_global.copy_from_slice(&global[state * GLOBAL_NUMBERS..][..GLOBAL_NUMBERS]);
        }
        batch
    });
}

#[test]
fn vectors_agree_with_pytorch() {
    baseline_agrees_with_pytorch("vector", VectorShape { outputs: 5 }, |generator, copies| {
        let states = generator.numbers(copies.len() * VECTOR_FEATURES);
        let mut batch = VectorBatch::default();
        let states = states.as_chunks().0.iter();
        for (state, preferences) in states.zip(preferences(generator, copies)) {
            batch.push(state, &preferences);
        }
        batch
    });
}
