//! Export of a parameter vector as a model file.
//!
//! [`export`] writes ONNX (operator set 17, standard operators only) with normalisation, masks and golden pairs. Weights
//! have the names and layouts of [`Shape::tensors`], so that other engines find them by name. [`gleaner_policy::onnx`]
//! documents the file.
//!
//! # When you may trust it
//! Tests of the workspace compare exported networks in tract and in onnxruntime with the trainer's forward pass. Every
//! program that loads an exported file runs its self-test.

mod builder;
mod graph;

use crate::net::{Batch, Shape, Workspace, forward};
use crate::observe::tokens::normalise;
use gleaner_policy::onnx::{self, Metadata, ModelError, pb};
use gleaner_policy::{Golden, Tokens};
use gleaner_units::Action;

pub use gleaner_policy::onnx::ModelCard;

/// Operator set of the graph: the first with layer normalisation, and one that tract supports.
const OPERATOR_SET: i64 = 17;
/// Version of the file format of [`OPERATOR_SET`].
const IR_VERSION: i64 = 8;

/// Why a network cannot be exported.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// Not an actor.
    #[error("a network with {outputs} outputs is no actor: export the one with {}", Action::COUNT)]
    NotAnActor {
        /// Its outputs.
        outputs: usize,
    },
    /// The number of parameters is wrong.
    #[error("{found} parameters do not fit the shape, which has {expected}")]
    Length {
        /// Parameters of the shape.
        expected: usize,
        /// Parameters given.
        found: usize,
    },
    /// The training diverged.
    #[error("parameter {index} of `{tensor}` is not finite: go back to an earlier checkpoint")]
    NotFinite {
        /// The tensor.
        tensor: String,
        /// Index in it.
        index: usize,
    },
    /// No golden pairs: every program would refuse the model.
    #[error("no golden pair: give some observations")]
    NoGolden,
}

/// The bytes of the model file.
///
/// # Errors
/// [`ExportError`]. A file that is written can be loaded.
pub fn export(
    actor: &[f32],
    shape: Shape,
    card: &ModelCard,
    goldens: &[Golden],
) -> Result<Vec<u8>, ExportError> {
    if shape.outputs != Action::COUNT {
        return Err(ExportError::NotAnActor { outputs: shape.outputs });
    }
    if actor.len() != shape.parameter_count() {
        return Err(ExportError::Length { expected: shape.parameter_count(), found: actor.len() });
    }
    for tensor in shape.tensors() {
        if let Some(index) = tensor.of(actor).iter().position(|number| !number.is_finite()) {
            return Err(ExportError::NotFinite { tensor: tensor.name, index });
        }
    }
    if goldens.is_empty() {
        return Err(ExportError::NoGolden);
    }
    let model = pb::ModelProto {
        ir_version: IR_VERSION,
        opset_import: vec![pb::OperatorSetIdProto { domain: String::new(), version: OPERATOR_SET }],
        producer_name: "gleaner".into(),
        producer_version: card.version.clone(),
        doc_string: "Inputs in physical units; the metadata say the rest.".into(),
        graph: Some(graph::actor(actor, shape)),
        ..Default::default()
    };
    let metadata =
        Metadata { card: card.clone(), parameters: shape.parameter_count(), goldens: goldens.to_vec() };
    Ok(onnx::seal(model, &metadata))
}

/// Golden pairs for these observations, computed by the trainer's forward pass.
///
/// # Panics
/// When `shape` is not that of an actor, or `actor` has another length.
#[must_use]
pub fn golden_pairs(actor: &[f32], shape: Shape, observations: &[Tokens]) -> Vec<Golden> {
    let mut batch = Batch::new();
    for tokens in observations {
        batch.push_sample(&normalise(tokens));
    }
    let mut workspace = Workspace::new();
    let outputs = forward(&shape, actor, &batch, &mut workspace);
    let (logits, _) = outputs.as_chunks::<{ Action::COUNT }>();
    observations
        .iter()
        .zip(logits)
        .map(|(tokens, &logits)| Golden { tokens: tokens.clone(), logits })
        .collect()
}

/// The parameter vector of a model that [`export`] wrote, for [`Shape::actor`].
///
/// # Errors
/// As [`read_policy`].
pub fn read_actor(bytes: &[u8]) -> Result<Vec<f32>, ModelError> {
    read_policy(bytes).map(|(actor, _)| actor)
}

/// [`read_actor`], and the model's origin.
///
/// # Errors
/// The file is damaged or of another contract, or lacks a weight.
pub fn read_policy(bytes: &[u8]) -> Result<(Vec<f32>, ModelCard), ModelError> {
    let (model, info, _) = onnx::unseal(bytes)?;
    let weights = model.graph.map(|graph| graph.initializer).unwrap_or_default();
    let mut actor = Vec::with_capacity(Shape::actor().parameter_count());
    for tensor in Shape::actor().tensors() {
        let found = weights.iter().find(|weight| weight.name == tensor.name);
        let (numbers, rest) = found.map_or(&[][..], |weight| &weight.raw_data).as_chunks::<4>();
        if numbers.len() != tensor.len() || !rest.is_empty() {
            let line = format!("the model has no weight `{}` of {} numbers", tensor.name, tensor.len());
            return Err(ModelError::Interface(line));
        }
        actor.extend(numbers.iter().map(|&bytes| f32::from_le_bytes(bytes)));
    }
    Ok((actor, info.card))
}

#[cfg(test)]
mod tests;
