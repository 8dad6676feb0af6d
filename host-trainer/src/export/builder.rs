//! Builds an ONNX graph node by node.

use gleaner_policy::onnx::Port;
use gleaner_policy::onnx::pb::attribute_proto::AttributeType;
use gleaner_policy::onnx::pb::tensor_proto::DataType;
use gleaner_policy::onnx::pb::tensor_shape_proto::{Dimension, dimension::Value as Dim};
use gleaner_policy::onnx::pb::type_proto;
use gleaner_policy::onnx::pb::{
    AttributeProto, GraphProto, NodeProto, TensorProto, TensorShapeProto, TypeProto, ValueInfoProto,
};

/// Name of the batch dimension.
const BATCH: &str = "N";

/// An incomplete graph. Values are identified by unique names.
pub(super) struct Builder(GraphProto);

impl Builder {
    pub fn new(name: &str, inputs: &[Port]) -> Builder {
        Builder(GraphProto {
            name: name.into(),
            input: inputs.iter().map(value_info).collect(),
            ..Default::default()
        })
    }

    pub fn finish(mut self, outputs: &[Port]) -> GraphProto {
        self.0.output = outputs.iter().map(value_info).collect();
        self.0
    }

    /// A constant f32 tensor.
    pub fn floats(&mut self, name: &str, shape: &[usize], numbers: &[f32]) -> String {
        let bytes = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.constant(name, DataType::Float, shape, bytes)
    }

    /// A constant list of i64, for shapes and axes.
    pub fn integers(&mut self, name: &str, numbers: &[i64]) -> String {
        let bytes = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.constant(name, DataType::Int64, &[numbers.len()], bytes)
    }

    fn constant(&mut self, name: &str, kind: DataType, shape: &[usize], raw_data: Vec<u8>) -> String {
        self.0.initializer.push(TensorProto {
            name: name.into(),
            dims: shape.iter().map(|&length| length as i64).collect(),
            data_type: kind as i32,
            raw_data,
            ..Default::default()
        });
        name.into()
    }

    /// A node with one output. Its name is that of the output.
    pub fn node(&mut self, operator: &str, inputs: &[&str], output: &str) -> String {
        self.node_with(operator, inputs, output, vec![])
    }

    /// As [`Builder::node`], with attributes.
    pub fn node_with(
        &mut self,
        operator: &str,
        inputs: &[&str],
        output: &str,
        attributes: Vec<AttributeProto>,
    ) -> String {
        self.split_with(operator, inputs, &[output], attributes);
        output.into()
    }

    /// A node with several outputs. Its name is that of the first one.
    pub fn split_with(
        &mut self,
        operator: &str,
        inputs: &[&str],
        outputs: &[&str],
        attribute: Vec<AttributeProto>,
    ) {
        self.0.node.push(NodeProto {
            name: outputs[0].into(),
            op_type: operator.into(),
            input: inputs.iter().map(|&name| name.into()).collect(),
            output: outputs.iter().map(|&name| name.into()).collect(),
            attribute,
            ..Default::default()
        });
    }
}

pub(super) fn int(name: &str, i: i64) -> AttributeProto {
    AttributeProto { name: name.into(), r#type: AttributeType::Int as i32, i, ..Default::default() }
}

pub(super) fn ints(name: &str, ints: &[i64]) -> AttributeProto {
    AttributeProto {
        name: name.into(),
        r#type: AttributeType::Ints as i32,
        ints: ints.to_vec(),
        ..Default::default()
    }
}

pub(super) fn float(name: &str, f: f32) -> AttributeProto {
    AttributeProto { name: name.into(), r#type: AttributeType::Float as i32, f, ..Default::default() }
}

fn value_info(port: &Port) -> ValueInfoProto {
    let dimension = |value| Dimension { value: Some(value), ..Default::default() };
    let lengths = port.shape.iter().map(|&length| dimension(Dim::DimValue(length as i64)));
    let dim = std::iter::once(dimension(Dim::DimParam(BATCH.into()))).chain(lengths).collect();
    let tensor =
        type_proto::Tensor { elem_type: DataType::Float as i32, shape: Some(TensorShapeProto { dim }) };
    ValueInfoProto {
        name: port.name.into(),
        r#type: Some(TypeProto { value: Some(type_proto::Value::TensorType(tensor)), ..Default::default() }),
        ..Default::default()
    }
}
