//! `gleaner seal`: makes an ONNX model of one's own flyable.
//!
//! A sealed model carries its name, the observation contract, golden pairs and a checksum. The golden inputs are those of
//! the built-in model, which cover the contract; the golden answers are the model's own.

use crate::args::Sealing;
use crate::error::StartError;
use crate::load;
use gleaner_policy::onnx::pb::ModelProto;
use gleaner_policy::onnx::{Metadata, ModelCard, ModelError, TractPolicy, seal, unseal};
use gleaner_policy::{GOLDEN_TOLERANCE, Golden, Policy, Tokens};
use gleaner_units::Action;
use prost::Message;
use std::fs;
use std::process::ExitCode;

/// Larger logits lose the precision with which golden pairs are compared.
const LARGEST_LOGIT: f32 = 1e4;

/// Writes the sealed file, after it was loaded as a program loads it to fly.
///
/// # Errors
/// The model cannot be read, does not keep the contract, or the file cannot be written.
pub fn run(order: &Sealing) -> Result<ExitCode, StartError> {
    let path = &order.model;
    let bytes = load::model_bytes(Some(path))?;
    let refused = |cause: SealError| StartError::Seal { path: path.clone(), source: cause };
    let sealed = sealed(&bytes, order).map_err(refused)?;
    fs::write(&order.out, &sealed.bytes)
        .map_err(|source| StartError::Write { path: order.out.clone(), source })?;
    println!(
        "wrote {}: {} parameters, {} golden pairs",
        order.out.display(),
        sealed.parameters,
        sealed.goldens
    );
    if !sealed.varies {
        println!("warning: the model gives the same answer to every observation");
    }
    Ok(ExitCode::SUCCESS)
}

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

struct Sealed {
    bytes: Vec<u8>,
    parameters: usize,
    goldens: usize,
    varies: bool,
}

fn sealed(bytes: &[u8], order: &Sealing) -> Result<Sealed, SealError> {
    let model = ModelProto::decode(bytes).map_err(|cause| ModelError::NotOnnx(cause.to_string()))?;
    let card = ModelCard {
        name: order.name.clone(),
        version: order.model_version.clone(),
        command: "gleaner seal".into(),
        scenario: order.scenario.clone(),
        ..ModelCard::default()
    };
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
