//! The contract that a sealed model keeps: it answers every observation of the built-in model's golden pairs, always
//! alike, with finite logits.
//!
//! A sealed model carries its name, the observation contract, golden pairs and a checksum. The golden inputs are those of
//! the built-in model, which cover the contract; the golden answers are the model's own.

use crate::load;
use gleaner_policy::onnx::pb::ModelProto;
use gleaner_policy::onnx::{Metadata, ModelCard, ModelError, TractPolicy, seal, unseal};
use gleaner_policy::{GOLDEN_TOLERANCE, Golden, Policy, Tokens};
use gleaner_units::Action;
use prost::Message;

/// Larger logits lose the precision with which golden pairs are compared.
const LARGEST_LOGIT: f32 = 1e4;

/// Why a model is not sealed.
#[derive(Debug, thiserror::Error)]
pub enum SealError {
    /// It is no model that a program could load.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// It has no answer to an observation.
    #[error("no answer to observation {index}: {cause}: correct the graph")]
    NoAnswer {
        /// Counted from 0.
        index: usize,
        /// Why.
        cause: String,
    },
    /// Two runs differ.
    #[error("observation {index} gets two different answers: remove dropout and random operators")]
    Random {
        /// Counted from 0.
        index: usize,
    },
    /// A logit is too large.
    #[error("a logit of {logit:e} for observation {index}: keep logits below {LARGEST_LOGIT:e}")]
    Range {
        /// Counted from 0.
        index: usize,
        /// The logit.
        logit: f32,
    },
}

/// A model that may fly.
pub struct Sealed {
    /// The file.
    pub bytes: Vec<u8>,
    /// Numbers in the weights.
    pub parameters: usize,
    /// Golden pairs.
    pub goldens: usize,
    /// Whether any two of its answers differ.
    pub varies: bool,
}

/// Seals an ONNX file, after it was loaded as a program loads it to fly.
///
/// # Errors
/// It is no model, or does not keep the contract.
pub fn sealed(bytes: &[u8], card: ModelCard) -> Result<Sealed, SealError> {
    let model = ModelProto::decode(bytes).map_err(|cause| ModelError::NotOnnx(cause.to_string()))?;
    let parameters = parameters(&model);
    let mut metadata = Metadata { card, parameters, goldens: Vec::new() };
    // Sealed without golden pairs it can be run, but not loaded to fly.
    let mut policy = TractPolicy::from_bytes(&seal(model.clone(), &metadata))?;
    for (index, tokens) in observations()?.into_iter().enumerate() {
        let logits = answer(&mut policy, index, &tokens)?;
        metadata.goldens.push(Golden { tokens, logits });
    }
    let bytes = seal(model, &metadata);
    TractPolicy::load_checked(&bytes)?;
    let goldens = metadata.goldens;
    let varies = goldens.windows(2).any(|pair| pair[0].logits != pair[1].logits);
    Ok(Sealed { bytes, parameters, goldens: goldens.len(), varies })
}

fn answer(
    policy: &mut TractPolicy,
    index: usize,
    tokens: &Tokens,
) -> Result<[f32; Action::COUNT], SealError> {
    let mut logits = || {
        let answer = policy.infer(tokens).map(|answer| answer.logits);
        answer.map_err(|cause| SealError::NoAnswer { index, cause: cause.to_string() })
    };
    let (first, second) = (logits()?, logits()?);
    if first.iter().zip(&second).any(|(a, b)| (a - b).abs() > GOLDEN_TOLERANCE) {
        return Err(SealError::Random { index });
    }
    match first.iter().find(|logit| logit.abs() > LARGEST_LOGIT) {
        Some(&logit) => Err(SealError::Range { index, logit }),
        None => Ok(first),
    }
}

/// The observations of the built-in model's golden pairs.
fn observations() -> Result<Vec<Tokens>, ModelError> {
    let (_, _, goldens) = unseal(load::SHIPPED)?;
    Ok(goldens.into_iter().map(|golden| golden.tokens).collect())
}

/// Numbers in the weights of the graph.
fn parameters(model: &ModelProto) -> usize {
    let weights = model.graph.iter().flat_map(|graph| &graph.initializer);
    weights
        .map(|tensor| {
            tensor.dims.iter().map(|&length| usize::try_from(length).unwrap_or(0)).product::<usize>()
        })
        .sum()
}
