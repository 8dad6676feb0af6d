//! The engine for hosts: the same network on the processor's vector unit.
//!
//! [`pulp`] selects the instruction set at run time (AVX2, AVX-512 or NEON), so one binary runs everywhere and no `unsafe`
//! code is needed here.
//!
//! Its results have the bits of the portable engine, and so of a microcontroller: each number is the same chain of
//! rounded operations. Vector lanes hold different outputs or different tokens, never parts of one sum, and
//! multiply-adds are not fused.

mod attention;
mod exponential;
mod kernel;
mod numbers;
mod pack;

use super::forward::{NativeError, normalise};
use super::model::Model;
use super::shape::{FEED_FORWARD, HEAD_HIDDEN, HEAD_INPUTS, WIDTH};
use crate::schema::{self, DEVICE_NORMALISATIONS, PREFERENCE_NORMALISATIONS, UAV_NORMALISATIONS};
use crate::{Attention, FIRST_DEVICE_TOKEN, Inference, LOCAL_MAP_CELLS, Policy, TOKENS, Tokens};
use attention::Attend;
use gleaner_units::Action;
use kernel::{ADD, Multiply, RECTIFY, STORE};
use numbers::Numbers;
use pack::{Packed, Weights};
use pulp::{Arch, Simd, WithSimd};

/// Observations that are computed together. More do not share weights better, and their activations leave the cache.
const TOGETHER: usize = 4;
/// Rows that [`Attend`] may write beyond the last token.
const SPARE_ROWS: usize = 8;
/// Query, key and value of a token.
const QKV: usize = 3 * WIDTH;

/// The engine for hosts with a vector unit: the bits of [`super::NativePolicy`] in a fraction of the time.
pub struct SimdPolicy {
    arch: Arch,
    weights: Box<Weights>,
    work: Box<Work>,
}

impl SimdPolicy {
    /// Repacks a model's weights; `None` if the processor has no supported vector unit.
    #[must_use]
    pub fn new(model: &Model<'_>) -> Option<SimdPolicy> {
        let arch = Arch::new();
        let lanes = arch.dispatch(CountLanes);
        (lanes > 1).then(|| SimdPolicy {
            arch,
            weights: Box::new(Weights::new(model, lanes)),
            work: Box::new(Work::new(lanes)),
        })
    }

    /// The instruction set in use, for reports.
    #[must_use]
    pub fn instruction_set(&self) -> &'static str {
        match (self.weights.lanes, cfg!(target_arch = "aarch64")) {
            (_, true) => "NEON",
            (8, _) => "AVX2",
            (16, _) => "AVX-512",
            _ => "SIMD",
        }
    }

    /// The logits of several observations. Faster than one by one, because weights are loaded once for several.
    ///
    /// # Errors
    /// As [`Policy::infer`], for the first observation that fails.
    pub fn logits_of(&mut self, batch: &[Tokens]) -> Result<Vec<[f32; Action::COUNT]>, NativeError> {
        let mut all = vec![[0.0; Action::COUNT]; batch.len()];
        for (tokens, logits) in batch.chunks(TOGETHER).zip(all.chunks_mut(TOGETHER)) {
            self.run(tokens, logits, None)?;
        }
        Ok(all)
    }

    fn run(
        &mut self,
        batch: &[Tokens],
        logits: &mut [[f32; Action::COUNT]],
        attention: Option<&mut Attention>,
    ) -> Result<(), NativeError> {
        for tokens in batch {
            let cells = tokens.local_map.len();
            if cells != LOCAL_MAP_CELLS {
                return Err(NativeError::LocalMap { cells });
            }
            let numbers = tokens.uav.iter().chain(&tokens.preference).chain(&tokens.local_map);
            // A maximum drops NaN, so an input that is not finite is found here and not at the end.
            if !numbers.chain(tokens.devices.iter().flatten()).all(|number| number.is_finite()) {
                return Err(NativeError::NotFinite);
            }
        }
        let SimdPolicy { arch, weights, work } = self;
        arch.dispatch(Forward { weights, work, batch, logits: &mut *logits, attention });
        let all_finite = logits.iter().flatten().all(|logit| logit.is_finite());
        if all_finite { Ok(()) } else { Err(NativeError::NotFinite) }
    }
}

impl Policy for SimdPolicy {
    type Error = NativeError;

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, NativeError> {
        let mut inference = Inference { logits: [0.0; Action::COUNT], attention: Attention::NONE };
        let logits = core::slice::from_mut(&mut inference.logits);
        self.run(core::slice::from_ref(tokens), logits, Some(&mut inference.attention))?;
        let all_finite = inference.attention.0.as_flattened().iter().all(|weight| weight.is_finite());
        if all_finite { Ok(inference) } else { Err(NativeError::NotFinite) }
    }

    fn logits(&mut self, tokens: &Tokens) -> Result<[f32; Action::COUNT], NativeError> {
        let mut logits = [[0.0; Action::COUNT]];
        self.run(core::slice::from_ref(tokens), &mut logits, None)?;
        let [logits] = logits;
        Ok(logits)
    }
}

struct CountLanes;

impl WithSimd for CountLanes {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F32_LANES
    }
}

/// The activations, token by token.
struct Work {
    /// `[rows][WIDTH]`.
    tokens: Numbers,
    /// `[rows][QKV]`.
    qkv: Numbers,
    /// `[rows][WIDTH]`.
    mixed: Numbers,
    /// `[rows][FEED_FORWARD]`.
    hidden: Numbers,
    /// `[observations][HEAD_INPUTS]`.
    joined: Numbers,
    /// `[observations][HEAD_HIDDEN]`.
    head: Numbers,
    /// `[observations][padded actions]`.
    logits: Numbers,
    attention: attention::Scratch,
}

impl Work {
    fn new(lanes: usize) -> Work {
        let rows = TOGETHER * TOKENS + SPARE_ROWS;
        Work {
            tokens: Numbers::zeros(rows * WIDTH),
            qkv: Numbers::zeros(rows * QKV),
            mixed: Numbers::zeros(rows * WIDTH),
            hidden: Numbers::zeros(rows * FEED_FORWARD),
            joined: Numbers::zeros(TOGETHER * HEAD_INPUTS),
            head: Numbers::zeros(TOGETHER * HEAD_HIDDEN),
            logits: Numbers::zeros(TOGETHER * Packed::padded(Action::COUNT, lanes)),
            attention: attention::Scratch::new(),
        }
    }
}

/// Tokens of an observation.
fn present(tokens: &Tokens) -> usize {
    FIRST_DEVICE_TOKEN + tokens.devices.len()
}

/// One forward pass.
struct Forward<'a> {
    weights: &'a Weights,
    work: &'a mut Work,
    batch: &'a [Tokens],
    logits: &'a mut [[f32; Action::COUNT]],
    /// Filled for the first observation.
    attention: Option<&'a mut Attention>,
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let rows = self.batch.iter().map(present).sum();
        self.embed(simd);
        let [first, last] = &self.weights.encoder;
        self.attend(simd, first, rows, false);
        self.finish_layer(simd, first, rows);
        self.attend(simd, last, rows, true);
        self.finish_layer(simd, last, rows);
        self.join();
        let (observations, width) = (self.batch.len(), self.weights.logits.outputs());
        let Work { joined, head, logits, .. } = &mut *self.work;
        let (joined, head) =
            (joined.first(observations * HEAD_INPUTS), head.first_mut(observations * HEAD_HIDDEN));
        simd.vectorize(Multiply::<RECTIFY> { layer: &self.weights.head, x: joined, y: head });
        let padded = logits.first_mut(observations * width);
        simd.vectorize(Multiply::<STORE> { layer: &self.weights.logits, x: head, y: padded });
        for (logits, padded) in self.logits.iter_mut().zip(padded.chunks_exact(width)) {
            for (logit, padded) in logits.iter_mut().zip(padded) {
                *logit = *padded;
            }
        }
    }
}

impl Forward<'_> {
    /// Normalises and projects each token into its row.
    #[inline(always)]
    fn embed<S: Simd>(&mut self, simd: S) {
        let mut tokens = self.work.tokens.all_mut();
        let mut project = |layer: &Packed, x: &[f32], rows: usize| {
            let (y, rest) = core::mem::take(&mut tokens).split_at_mut(rows * WIDTH);
            tokens = rest;
            simd.vectorize(Multiply::<STORE> { layer, x, y });
        };
        for observation in self.batch {
            project(&self.weights.uav, &normalise(&observation.uav, &UAV_NORMALISATIONS), 1);
            let preference = normalise(&observation.preference, &PREFERENCE_NORMALISATIONS);
            project(&self.weights.preference, &preference, 1);
            let mut map = [0.0; LOCAL_MAP_CELLS];
            for (normalised, units) in map.iter_mut().zip(&observation.local_map) {
                *normalised = schema::YIELD.apply(*units);
            }
            project(&self.weights.map, &map, 1);
            let mut devices = [[0.0; schema::DEVICE_FEATURES]; crate::K_MAX];
            for (normalised, device) in devices.iter_mut().zip(&observation.devices) {
                *normalised = normalise(device, &DEVICE_NORMALISATIONS);
            }
            let rows = observation.devices.len();
            let (devices, _) = devices.as_flattened().split_at(rows * schema::DEVICE_FEATURES);
            project(&self.weights.device, devices, rows);
        }
    }

    /// Query, key and value of each token, and the attention of each observation.
    #[inline(always)]
    fn attend<S: Simd>(&mut self, simd: S, layer: &pack::Encoder, rows: usize, is_last: bool) {
        let Work { tokens, qkv, mixed, attention: scratch, .. } = &mut *self.work;
        let x = tokens.first(rows * WIDTH);
        simd.vectorize(Multiply::<STORE> { layer: &layer.qkv, x, y: qkv.first_mut(rows * QKV) });
        let (mut qkv, mut mixed) = (qkv.all(), mixed.all_mut());
        for (index, observation) in self.batch.iter().enumerate() {
            let tokens = present(observation);
            let explain = self.attention.as_deref_mut().filter(|_| is_last && index == 0);
            simd.vectorize(Attend { qkv, mixed: &mut *mixed, tokens, scratch: &mut *scratch, explain });
            let (_, rest) = qkv.split_at(tokens * QKV);
            qkv = rest;
            let (_, rest) = core::mem::take(&mut mixed).split_at_mut(tokens * WIDTH);
            mixed = rest;
        }
    }

    /// The layer after its attention: `x = norm(x + out(mixed))`, `x = norm(x + ff(x))`.
    #[inline(always)]
    fn finish_layer<S: Simd>(&mut self, simd: S, layer: &pack::Encoder, rows: usize) {
        let Work { tokens, mixed, hidden, .. } = &mut *self.work;
        let tokens = tokens.first_mut(rows * WIDTH);
        let hidden = hidden.first_mut(rows * FEED_FORWARD);
        simd.vectorize(Multiply::<ADD> { layer: &layer.out, x: mixed.first(rows * WIDTH), y: tokens });
        simd.vectorize(kernel::Normalise { norm: &layer.norm1, x: tokens });
        simd.vectorize(Multiply::<RECTIFY> { layer: &layer.ff1, x: tokens, y: hidden });
        simd.vectorize(Multiply::<ADD> { layer: &layer.ff2, x: hidden, y: tokens });
        simd.vectorize(kernel::Normalise { norm: &layer.norm2, x: tokens });
    }

    /// The head's inputs: aircraft, preference, map, and the maximum of each device feature (zero without devices).
    #[inline(always)]
    fn join(&mut self) {
        let Work { tokens, joined, .. } = &mut *self.work;
        let mut rows = tokens.all();
        for (observation, joined) in self.batch.iter().zip(joined.all_mut().chunks_exact_mut(HEAD_INPUTS)) {
            let (own, rest) = rows.split_at(present(observation) * WIDTH);
            rows = rest;
            let (fixed, pooled) = joined.split_at_mut(FIRST_DEVICE_TOKEN * WIDTH);
            let (own_fixed, devices) = own.split_at(FIRST_DEVICE_TOKEN * WIDTH);
            fixed.copy_from_slice(own_fixed);
            let mut devices = devices.chunks_exact(WIDTH);
            match devices.next() {
                Some(first) => pooled.copy_from_slice(first),
                None => pooled.fill(0.0),
            }
            for device in devices {
                for (largest, number) in pooled.iter_mut().zip(device) {
                    *largest = if *largest > *number { *largest } else { *number };
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::native::{AlignedBytes, Model, NativePolicy, WeightFormat, Workspace};
    use crate::onnx::convert;
    use crate::testing::observations;

    #[test]
    fn bits_are_those_of_the_portable_engine() {
        let onnx = std::fs::read("../../models/gleaner.onnx").expect("the shipped model");
        for format in WeightFormat::ALL {
            let blob = AlignedBytes::new(&convert(&onnx, format).expect("a model that can be converted"));
            let model = Model::read(blob.as_slice()).expect("a valid blob");
            let mut workspace = Workspace::new();
            let mut portable = NativePolicy::new(model, &mut workspace);
            let mut simd = SimdPolicy::new(&model).expect("tests run where there is a vector unit");
            for batch in observations(1300).chunks(7) {
                let together = simd.logits_of(batch).expect("logits");
                for (tokens, together) in batch.iter().zip(together) {
                    let exact = portable.infer(tokens).expect("logits");
                    assert_eq!(
                        simd.infer(tokens).expect("logits"),
                        exact,
                        "{} devices",
                        tokens.devices.len()
                    );
                    assert_eq!(together, exact.logits);
                }
            }
        }
    }
}
