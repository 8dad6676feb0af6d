//! The inputs and outputs of every model.

use super::error::ModelError;
use super::pb::tensor_proto::{DataLocation, DataType};
use super::pb::tensor_shape_proto::dimension::Value as Dim;
use super::pb::type_proto::Value as Type;
use super::pb::{GraphProto, TensorProto, ValueInfoProto};
use crate::schema::{DEVICE_FEATURES, PREFERENCE_FEATURES, UAV_FEATURES};
use crate::{K_MAX, LOCAL_MAP_CELLS, TOKENS};
use gleaner_units::Action;
use std::collections::HashSet;

/// One input or output of the graph: f32, the batch dimension first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// Its name in the graph.
    pub name: &'static str,
    /// Its dimensions after the batch.
    pub shape: &'static [usize],
}

/// The inputs, in physical units (see [`crate::schema`]). `device_mask` is 1 for each device that is present; the rows of
/// the others are ignored.
pub const INPUTS: [Port; 5] = [
    Port { name: "uav", shape: &[UAV_FEATURES] },
    Port { name: "devices", shape: &[K_MAX, DEVICE_FEATURES] },
    Port { name: "device_mask", shape: &[K_MAX] },
    Port { name: "preference", shape: &[PREFERENCE_FEATURES] },
    Port { name: "local_map", shape: &[LOCAL_MAP_CELLS] },
];

/// The outputs: one logit per action, and the attention of the second layer (see [`crate::Attention`]).
pub const OUTPUTS: [Port; 2] =
    [Port { name: "logits", shape: &[Action::COUNT] }, Port { name: "attention", shape: &[TOKENS, TOKENS] }];

/// Checks that the graph has exactly the contract's inputs and outputs, and that the file contains all weights.
pub(super) fn check(graph: &GraphProto) -> Result<(), ModelError> {
    let weights: HashSet<&str> = graph.initializer.iter().map(|tensor| tensor.name.as_str()).collect();
    let inputs: Vec<&ValueInfoProto> =
        graph.input.iter().filter(|input| !weights.contains(input.name.as_str())).collect();
    check_side("input", &inputs, &INPUTS)?;
    check_side("output", &graph.output.iter().collect::<Vec<_>>(), &OUTPUTS)?;
    let made: HashSet<&str> = graph.node.iter().flat_map(|node| &node.output).map(String::as_str).collect();
    for output in &OUTPUTS {
        if !made.contains(output.name) {
            return Err(ModelError::Interface(format!("no node computes the output `{}`", output.name)));
        }
    }
    let mut tensors = graph.initializer.iter().chain(constants(graph));
    match tensors.find(|tensor| tensor.data_location == Some(DataLocation::External as i32)) {
        Some(tensor) => {
            Err(ModelError::Interface(format!("the weight `{}` is in another file", tensor.name)))
        }
        None => Ok(()),
    }
}

fn constants(graph: &GraphProto) -> impl Iterator<Item = &TensorProto> {
    graph.node.iter().flat_map(|node| &node.attribute).filter_map(|attribute| attribute.t.as_ref())
}

fn check_side(side: &str, found: &[&ValueInfoProto], wanted: &[Port]) -> Result<(), ModelError> {
    for port in wanted {
        let Some(value) = found.iter().find(|value| value.name == port.name) else {
            return Err(ModelError::Interface(format!("the model has no {side} `{}`", port.name)));
        };
        let (is, should) = (describe(value), describe_port(port));
        if is != should {
            return Err(ModelError::Interface(format!("{side} `{}` is {is}, not {should}", port.name)));
        }
    }
    match found.iter().find(|value| wanted.iter().all(|port| port.name != value.name)) {
        Some(value) => {
            Err(ModelError::Interface(format!("the model has an unknown {side} `{}`", value.name)))
        }
        None => Ok(()),
    }
}

fn describe_port(port: &Port) -> String {
    let shape: Vec<String> = port.shape.iter().map(|length| format!("{length}")).collect();
    format!("f32 [N,{}]", shape.join(","))
}

/// The first axis is the batch, whatever its name; a fixed batch is shown as a number.
fn describe(value: &ValueInfoProto) -> String {
    let Some(Type::TensorType(tensor)) = value.r#type.as_ref().and_then(|t| t.value.as_ref()) else {
        return String::from("without a type");
    };
    let element = match DataType::try_from(tensor.elem_type) {
        Ok(DataType::Float) => "f32".into(),
        Ok(other) => format!("{other:?}").to_lowercase(),
        Err(_) => String::from("of unknown element type"),
    };
    let Some(shape) = &tensor.shape else {
        return format!("{element} without a shape");
    };
    let dimensions: Vec<String> = shape
        .dim
        .iter()
        .enumerate()
        .map(|(index, dimension)| match &dimension.value {
            Some(Dim::DimValue(length)) => format!("{length}"),
            Some(Dim::DimParam(_)) if index == 0 => String::from("N"),
            Some(Dim::DimParam(name)) => name.clone(),
            None => String::from("?"),
        })
        .collect();
    format!("{element} [{}]", dimensions.join(","))
}
