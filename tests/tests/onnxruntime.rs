//! One model file, three engines, one result: the trainer's forward pass, tract, and onnxruntime as the judge.

use gleaner_host_trainer::export::{ModelCard, export, golden_pairs, read_actor};
use gleaner_host_trainer::net::{Batch, Shape, Workspace, forward};
use gleaner_host_trainer::observe::tokens::normalise;
use gleaner_policy::onnx::{INPUTS, TractPolicy};
use gleaner_policy::{Attention, Inference, K_MAX, Policy, Tokens};
use gleaner_tests::observations::random;
use gleaner_tests::python;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};

/// Largest difference due to rounding.
const TOLERANCE: f32 = 1e-4;
/// Observations per network.
const OBSERVATIONS: usize = 256;

fn ask_trainer(actor: &[f32], observations: &[Tokens]) -> Vec<Inference> {
    let mut batch = Batch::new();
    for tokens in observations {
        batch.push_sample(&normalise(tokens));
    }
    let mut workspace = Workspace::new();
    let logits = forward(&Shape::actor(), actor, &batch, &mut workspace).to_vec();
    let (logits, _) = logits.as_chunks::<5>();
    let answer = |(sample, &logits)| Inference { logits, attention: Attention(workspace.attention(sample)) };
    logits.iter().enumerate().map(answer).collect()
}

fn ask_tract(file: &[u8], observations: &[Tokens]) -> Vec<Inference> {
    let mut policy = TractPolicy::load_checked(file).expect("the model proves itself");
    observations.iter().map(|tokens| policy.infer(tokens).expect("an answer")).collect()
}

/// Evaluates all observations as one batch. The rows of absent devices hold garbage, which must not matter.
fn ask_onnxruntime(file: &[u8], observations: &[Tokens]) -> Vec<Inference> {
    let folder = tempfile::tempdir().expect("a folder");
    for port in &INPUTS {
        let numbers: Vec<f32> = match port.name {
            "uav" => observations.iter().flat_map(|tokens| tokens.uav).collect(),
            "devices" => observations.iter().flat_map(device_rows_with_garbage).collect(),
            "device_mask" => observations
                .iter()
                .flat_map(|tokens| (0..K_MAX).map(|slot| f32::from(u8::from(slot < tokens.devices.len()))))
                .collect(),
            "preference" => observations.iter().flat_map(|tokens| tokens.preference).collect(),
            "local_map" => observations.iter().flat_map(|tokens| tokens.local_map.iter().copied()).collect(),
            other => panic!("the contract has an input that this test does not know: {other}"),
        };
        write_floats(&folder.path().join(format!("{}.f32", port.name)), &numbers);
    }
    let model = folder.path().join("model.onnx");
    std::fs::write(&model, file).expect("the model is written");
    let outcome = python::run("onnxruntime_check.py", [&model, &folder.path().to_path_buf()]);
    outcome.unwrap_or_else(|cause| panic!("{cause:#}"));
    let logits = read_floats(&folder.path().join("logits.f32"));
    let attention = read_floats(&folder.path().join("attention.f32"));
    let (logits, _) = logits.as_chunks::<5>();
    let (rows, _) = attention.as_chunks::<15>();
    let (attention, _) = rows.as_chunks::<15>();
    assert_eq!((logits.len(), attention.len()), (OBSERVATIONS, OBSERVATIONS));
    let answers = logits.iter().zip(attention);
    answers.map(|(&logits, &attention)| Inference { logits, attention: Attention(attention) }).collect()
}

fn device_rows_with_garbage(tokens: &Tokens) -> Vec<f32> {
    let garbage = [f32::MAX, -1e30, 7.0, f32::MIN, 1e9, -3.0, 1e20];
    let rows = tokens.devices.iter().chain(std::iter::repeat(&garbage)).take(K_MAX);
    rows.flatten().copied().collect()
}

fn write_floats(path: &Path, numbers: &[f32]) {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    std::fs::write(path, bytes).expect("the input is written");
}

fn read_floats(path: &Path) -> Vec<f32> {
    let bytes = std::fs::read(path).expect("the output is there");
    let (numbers, rest) = bytes.as_chunks::<4>();
    assert!(rest.is_empty());
    numbers.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

/// The largest difference of logits and of attention; NaN counts as infinite.
fn difference(a: &[Inference], b: &[Inference]) -> (f32, f32) {
    assert_eq!(a.len(), b.len());
    let apart = |a: &f32, b: &f32| if (a - b).is_nan() { f32::INFINITY } else { (a - b).abs() };
    let (mut logits, mut attention) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        for (a, b) in a.logits.iter().zip(&b.logits) {
            logits = f32::max(logits, apart(a, b));
        }
        for (a, b) in a.attention.0.as_flattened().iter().zip(b.attention.0.as_flattened()) {
            attention = f32::max(attention, apart(a, b));
        }
    }
    (logits, attention)
}

/// Rows and columns of absent devices are exactly zero, every other row sums to one.
fn assert_attention_is_masked(engine: &str, answers: &[Inference], observations: &[Tokens]) {
    for (sample, (answer, tokens)) in answers.iter().zip(observations).enumerate() {
        let tokens = 3 + tokens.devices.len();
        for (query, row) in answer.attention.0.iter().enumerate() {
            let sum: f32 = row.iter().sum();
            let expected = if query < tokens { 1.0 } else { 0.0 };
            assert!((sum - expected).abs() < 1e-5, "{engine}, sample {sample}, row {query}: {sum}");
            assert!(row[tokens..].iter().all(|&weight| weight == 0.0), "{engine}, sample {sample}: {row:?}");
        }
    }
}

/// Evaluates all engines and compares each with the trainer.
fn assert_all_agree(what: &str, file: &[u8], actor: &[f32]) {
    let observations = random(&mut ChaCha8Rng::seed_from_u64(11), OBSERVATIONS);
    let trainer = ask_trainer(actor, &observations);
    let engines =
        [("tract", ask_tract(file, &observations)), ("onnxruntime", ask_onnxruntime(file, &observations))];
    assert_attention_is_masked("trainer", &trainer, &observations);
    for (engine, answers) in &engines {
        let (logits, attention) = difference(&trainer, answers);
        println!("{what}: {engine} against the trainer: logits {logits:.1e}, attention {attention:.1e}");
        assert!(logits <= TOLERANCE, "{what}: logits of {engine} are {logits:e} from the trainer's");
        assert!(attention <= TOLERANCE, "{what}: attention of {engine} is {attention:e} from the trainer's");
        assert_attention_is_masked(engine, answers, &observations);
    }
}

#[test]
fn initial_networks_agree_in_every_engine() {
    // Initial weights give nearly uniform attention; scaled ones do not.
    for (what, sharpness) in [("as drawn", 1.0), ("sharpened", 2.5)] {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut actor = Shape::actor().initialise(&mut rng);
        actor.iter_mut().for_each(|number| *number *= sharpness);
        let goldens = golden_pairs(&actor, Shape::actor(), &random(&mut rng, 16));
        let card = ModelCard { name: what.into(), ..ModelCard::default() };
        let file = export(&actor, Shape::actor(), &card, &goldens).expect("a model");
        assert_eq!(read_actor(&file).expect("its weights"), actor);
        assert_all_agree(what, &file, &actor);
    }
}

#[test]
fn shipped_models_agree_in_every_engine() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models");
    let entries = std::fs::read_dir(&folder).expect("the folder models/ is there");
    let mut models: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    models.retain(|path| path.extension().is_some_and(|extension| extension == "onnx"));
    models.sort();
    assert!(!models.is_empty(), "models/ holds no model: train one with `gleaner-train train`");
    for path in models {
        let file = std::fs::read(&path).expect("the model is readable");
        let actor = read_actor(&file).unwrap_or_else(|cause| panic!("{}: {cause}", path.display()));
        assert_all_agree(&path.display().to_string(), &file, &actor);
    }
}
