//! The native engine's two implementations against each other and against tract: one model, the same decisions.

use gleaner_host_trainer::export::read_actor;
use gleaner_policy::native::{AlignedBytes, Model, NativePolicy, SimdPolicy, WeightFormat, Workspace};
use gleaner_policy::onnx::{TractPolicy, convert};
use gleaner_policy::{FIRST_DEVICE_TOKEN, GOLDEN_TOLERANCE, Inference, K_MAX, Policy, Tokens};
use gleaner_tests::observations::{flown, random};
use gleaner_tests::programs::repository;
use gleaner_units::ActionMask;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::thread;

const RANDOM: usize = 100_000;
const FLOWN: usize = 10_000;

fn shipped(name: &str) -> Vec<u8> {
    std::fs::read(repository().join("models").join(name)).expect("a file of models/")
}

fn blob(format: WeightFormat) -> AlignedBytes {
    AlignedBytes::new(&convert(&shipped("gleaner.onnx"), format).expect("a model that can be converted"))
}

/// Runs `ask` with the portable engine and the shipped model.
fn with_native<T>(format: WeightFormat, ask: impl FnOnce(&mut NativePolicy<'_>) -> T) -> T {
    let blob = blob(format);
    let mut workspace = Workspace::new();
    let model = Model::read(blob.as_slice()).expect("a blob that was just made");
    ask(&mut NativePolicy::new(model, &mut workspace))
}

/// Largest differences between two engines.
#[derive(Clone, Copy, Debug, Default)]
struct Apart {
    logits: f32,
    attention: f32,
    decisions: usize,
}

impl Apart {
    fn add(&mut self, a: &Inference, b: &Inference, mask: ActionMask) {
        let largest = |a: &[f32], b: &[f32]| {
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |largest, apart| {
                if apart.is_nan() { f32::INFINITY } else { f32::max(largest, apart) }
            })
        };
        self.logits = self.logits.max(largest(&a.logits, &b.logits));
        let attention = largest(a.attention.0.as_flattened(), b.attention.0.as_flattened());
        self.attention = self.attention.max(attention);
        self.decisions += usize::from(mask.argmax(&a.logits) != mask.argmax(&b.logits));
    }

    fn join(self, other: Apart) -> Apart {
        Apart {
            logits: self.logits.max(other.logits),
            attention: self.attention.max(other.attention),
            decisions: self.decisions + other.decisions,
        }
    }
}

/// Splits the observations over all processors; returns the result of each part.
fn on_all_processors<T: Send>(
    observations: &[(Tokens, ActionMask)],
    compare: impl Fn(&[(Tokens, ActionMask)]) -> T + Copy + Send + Sync,
) -> Vec<T> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        let parts = observations.chunks(observations.len().div_ceil(threads));
        let parts: Vec<_> = parts.map(|part| scope.spawn(move || compare(part))).collect();
        parts.into_iter().map(|part| part.join().expect("no panic")).collect()
    })
}

/// The portable engine against tract.
fn compare(format: WeightFormat, observations: &[(Tokens, ActionMask)]) -> Apart {
    let parts = on_all_processors(observations, |part| compare_here(format, part));
    parts.into_iter().fold(Apart::default(), Apart::join)
}

/// The vectorised engine against the portable one, observations alone and in batches: every bit is the same.
fn assert_same_bits(observations: &[(Tokens, ActionMask)]) {
    with_native(WeightFormat::F32, |portable| {
        let mut simd = SimdPolicy::new(portable.model()).expect("tests run where there is a vector unit");
        for batch in observations.chunks(7) {
            let tokens: Vec<Tokens> = batch.iter().map(|(tokens, _)| tokens.clone()).collect();
            let together = simd.logits_of(&tokens).expect("logits");
            for (tokens, together) in tokens.iter().zip(together) {
                let exact = portable.infer(tokens).expect("logits");
                assert_eq!(simd.infer(tokens).expect("logits"), exact, "{tokens:?}");
                assert_eq!(together, exact.logits, "in a batch: {tokens:?}");
            }
        }
    });
}

fn compare_here(format: WeightFormat, observations: &[(Tokens, ActionMask)]) -> Apart {
    let mut tract = TractPolicy::load_checked(&shipped("gleaner.onnx")).expect("the model proves itself");
    with_native(format, |native| {
        let mut apart = Apart::default();
        for (tokens, mask) in observations {
            let (a, b) = (tract.infer(tokens).expect("an answer"), native.infer(tokens).expect("an answer"));
            apart.add(&a, &b, *mask);
        }
        apart
    })
}

/// The flashed model is derived from the ONNX file.
#[test]
fn committed_blob_is_the_committed_model_converted() {
    assert!(
        blob(WeightFormat::F32).as_slice() == shipped("gleaner.gln"),
        "models/gleaner.gln is not made from models/gleaner.onnx: type cargo run --release -p gleaner-companion -- \
         convert models/gleaner.onnx --out models/gleaner.gln"
    );
}

fn random_observations() -> Vec<(Tokens, ActionMask)> {
    let mut rng = ChaCha8Rng::seed_from_u64(404);
    let observations = random(&mut rng, RANDOM);
    let mut mask = || ActionMask::from_bits(rng.random_range(1..32));
    observations.into_iter().map(|tokens| (tokens, mask())).collect()
}

fn flown_observations() -> Vec<(Tokens, ActionMask)> {
    flown(&read_actor(&shipped("gleaner.onnx")).expect("the trainer's weights"), FLOWN)
}

fn assert_portable_agrees_with_tract(observations: &[(Tokens, ActionMask)]) {
    let apart = compare(WeightFormat::F32, observations);
    println!("portable and tract, {} observations: {apart:?}", observations.len());
    assert!(apart.logits <= GOLDEN_TOLERANCE && apart.attention <= GOLDEN_TOLERANCE, "{apart:?}");
    assert_eq!(apart.decisions, 0, "{apart:?}");
}

#[test]
fn portable_and_tract_agree_on_random_observations() {
    assert_portable_agrees_with_tract(&random_observations());
}

#[test]
fn portable_and_tract_agree_on_flown_observations() {
    assert_portable_agrees_with_tract(&flown_observations());
}

#[test]
fn vectorised_has_the_portable_bits_on_random_observations() {
    on_all_processors(&random_observations(), assert_same_bits);
}

#[test]
fn vectorised_has_the_portable_bits_on_flown_observations() {
    on_all_processors(&flown_observations(), assert_same_bits);
}

/// Half the flash for less than one decision in a thousand.
#[test]
fn with_16_bits_nearly_all_decisions_are_the_same() {
    let actor = read_actor(&shipped("gleaner.onnx")).expect("the trainer's weights");
    let apart = compare(WeightFormat::I16, &flown(&actor, FLOWN));
    println!("{FLOWN} flown observations, 16 bits: {apart:?}");
    assert!(apart.decisions * 1000 <= FLOWN, "other decisions: {apart:?}");
}

#[test]
fn device_order_does_not_matter() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let observations = random(&mut rng, 20 * (K_MAX + 1));
    with_native(WeightFormat::F32, |native| {
        for tokens in observations {
            let mut order: Vec<usize> = (0..tokens.devices.len()).collect();
            order.shuffle(&mut rng);
            let mut shuffled = tokens.clone();
            shuffled.devices = order.iter().map(|&from| tokens.devices[from]).collect();
            let [a, mut b] = [native.infer(&tokens).unwrap(), native.infer(&shuffled).unwrap()];
            // Back into the order of `tokens`.
            let place: Vec<usize> =
                (0..FIRST_DEVICE_TOKEN).chain(order.iter().map(|from| FIRST_DEVICE_TOKEN + from)).collect();
            let mixed = b.attention.clone();
            for (row, &query) in mixed.0.iter().zip(&place) {
                for (weight, &key) in row.iter().zip(&place) {
                    b.attention.0[query][key] = *weight;
                }
            }
            let mut apart = Apart::default();
            apart.add(&a, &b, ActionMask::FULL);
            // Sums of another order, through all layers. Drawn maps are bright everywhere, so the numbers inside are
            // larger than the logits.
            let largest = a.logits.iter().fold(1.0_f32, |largest, logit| largest.max(logit.abs()));
            assert!(
                apart.logits < 4e-6 * largest && apart.attention < 2e-5,
                "{order:?}: {apart:?}, largest logit {largest}"
            );
        }
    });
}

/// Lanes of absent devices hold numbers of earlier observations.
#[test]
fn absent_devices_and_earlier_observations_leave_no_trace() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let observations = random(&mut rng, 4 * (K_MAX + 1));
    let mut full = observations[K_MAX].clone();
    assert_eq!(full.devices.len(), K_MAX);
    let mut endless = full.clone();
    endless.uav[0] = f32::INFINITY;
    full.devices.iter_mut().flatten().for_each(|number| *number *= 1e6);
    for format in WeightFormat::ALL {
        for tokens in &observations {
            let fresh = with_native(format, |native| native.infer(tokens).unwrap());
            let used = with_native(format, |native| {
                native.infer(&full).unwrap();
                assert!(native.infer(&endless).is_err(), "an endless battery has no answer");
                native.infer(tokens).unwrap()
            });
            assert_eq!(fresh, used, "to the last bit, {} devices", tokens.devices.len());
            let present = FIRST_DEVICE_TOKEN + tokens.devices.len();
            for (query, row) in used.attention.0.iter().enumerate() {
                let sum: f32 = row.iter().sum();
                let expected = if query < present { 1.0 } else { 0.0 };
                assert!((sum - expected).abs() < 1e-5, "row {query} of {present}: {sum}");
                assert!(row[present..].iter().all(|&weight| weight == 0.0), "{row:?}");
            }
        }
    }
}
