//! From a parameter vector to the model file.
//!
//! [`export`] writes ONNX (operator set 17, standard operators only), with normalisation, masks and golden pairs
//! inside. Every weight keeps the name and the layout that [`Shape::tensors`] gives it, so that other engines
//! find it by name. What the file promises to its readers stands in [`gleaner_policy::onnx`].
//!
//! # When you may trust it
//! The workspace's tests compare exported networks with the trainer's own forward pass in tract and in
//! onnxruntime. An exported file proves itself again wherever it is loaded.

mod builder;
mod graph;

use crate::net::{Batch, Shape, Workspace, forward};
use crate::observe::tokens::normalise;
use gleaner_policy::onnx::{self, Metadata, ModelError, pb};
use gleaner_policy::{Golden, Tokens};
use gleaner_units::Action;

pub use gleaner_policy::onnx::ModelCard;

/// Operator set of the graph: the first with layer normalisation, and one that tract is tested with.
const OPERATOR_SET: i64 = 17;
/// Version of the file format that came with [`OPERATOR_SET`].
const IR_VERSION: i64 = 8;

/// Why a network cannot become a model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// Not an actor.
    #[error("a network with {outputs} outputs is no actor: export the one with {}", Action::COUNT)]
    NotAnActor {
        /// Outputs that it has.
        outputs: usize,
    },
    /// The parameters are those of another shape.
    #[error("{found} parameters do not fit the shape, which has {expected}")]
    Length {
        /// What the shape asks for.
        expected: usize,
        /// What was given.
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
    /// A model that proves nothing would be refused everywhere.
    #[error("no golden pair: give some observations")]
    NoGolden,
}

/// The bytes of the model file.
///
/// # Errors
/// [`ExportError`]; a file that is written can be loaded.
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

/// Golden pairs for these observations, computed by the trainer's own forward pass.
///
/// # Panics
/// When `shape` is no actor's or `actor` does not fit it.
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
/// The file is damaged or of another contract, or a weight is not there under its name.
pub fn read_actor(bytes: &[u8]) -> Result<Vec<f32>, ModelError> {
    let (model, _, _) = onnx::unseal(bytes)?;
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
    Ok(actor)
}

#[cfg(test)]
mod tests;
