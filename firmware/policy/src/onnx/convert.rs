//! Conversion of the ONNX file to the blob of the native engine.

use super::error::{ConvertError, ModelError};
use super::metadata::{ModelInfo, unseal};
use super::pb::tensor_proto::DataType;
use super::pb::{GraphProto, TensorProto};
use crate::native::{
    AlignedBytes, FEED_FORWARD, HEAD_HIDDEN, HEAD_INPUTS, HEAD_WIDTH, Header, LAYERS, LOGIT_PANELS, Model,
    NativePolicy, PANEL, SOURCE_BYTES, WIDTH, WeightFormat, Workspace, crc32,
};
use crate::schema::{DEVICE_FEATURES, PREFERENCE_FEATURES, UAV_FEATURES};
use crate::{Golden, K_MAX, LOCAL_MAP_CELLS, Policy, SelfTestError, self_test};
use gleaner_units::{Action, ActionMask};

/// Converts an ONNX model to a blob for [`Model::read`] and checks the blob's golden pairs. Deterministic.
///
/// With 16-bit weights the blob's golden logits are recomputed with those weights, so that the self-test on board is
/// exact. The conversion fails if a golden pair then selects another action.
///
/// # Errors
/// [`ConvertError`].
pub fn convert(onnx: &[u8], format: WeightFormat) -> Result<Vec<u8>, ConvertError> {
    let (model, info, mut goldens) = unseal(onnx)?;
    let graph = model.graph.unwrap_or_default();
    check_operators(&graph)?;
    let mut network = Writer { graph: &graph, format, bytes: Vec::new() };
    network.network()?;
    if format != WeightFormat::F32 {
        let trained = blob(&info, &goldens, format, &network.bytes)?;
        recompute_goldens(&trained, &mut goldens)?;
    }
    let bytes = blob(&info, &goldens, format, &network.bytes)?;
    check_goldens(&bytes)?;
    Ok(bytes)
}

fn check_goldens(bytes: &[u8]) -> Result<(), ModelError> {
    let aligned = AlignedBytes::new(bytes);
    let model = Model::read(aligned.as_slice())?;
    Ok(self_test(&mut NativePolicy::new(model, &mut Workspace::new()), model.goldens())?)
}

/// Replaces the golden logits by those of the blob's own weights.
fn recompute_goldens(bytes: &[u8], goldens: &mut [Golden]) -> Result<(), ConvertError> {
    let aligned = AlignedBytes::new(bytes);
    let mut workspace = Workspace::new();
    let mut policy =
        NativePolicy::new(Model::read(aligned.as_slice()).map_err(ModelError::Blob)?, &mut workspace);
    for (pair, golden) in goldens.iter_mut().enumerate() {
        let answer = policy.infer(&golden.tokens);
        let logits = answer.map_err(|_| ModelError::SelfTest(SelfTestError::NoAnswer { pair }))?.logits;
        if ActionMask::FULL.argmax(&logits) != ActionMask::FULL.argmax(&golden.logits) {
            return Err(ConvertError::Disagrees { pair });
        }
        golden.logits = logits;
    }
    Ok(())
}

fn blob(
    info: &ModelInfo,
    goldens: &[Golden],
    format: WeightFormat,
    network: &[u8],
) -> Result<Vec<u8>, ConvertError> {
    let mut source = [0; SOURCE_BYTES];
    for (byte, digits) in source.iter_mut().zip(info.sha256.as_bytes().as_chunks::<2>().0) {
        // `unseal` made the digest, so it is hexadecimal.
        *byte =
            digits.iter().fold(0, |byte, &digit| byte << 4 | (digit as char).to_digit(16).unwrap_or(0) as u8);
    }
    let header = Header {
        weights: format,
        goldens: goldens.len() as u32,
        source,
        name: padded("name", &info.card.name)?,
        version: padded("version", &info.card.version)?,
    };
    let pairs: Vec<u8> = goldens.iter().flat_map(golden_bytes).collect();
    let length = header.to_bytes(0).len() + pairs.len() + network.len() + size_of::<u32>();
    let mut bytes = [&header.to_bytes(length as u32), &pairs, network].concat();
    bytes.extend(crc32(&bytes).to_le_bytes());
    Ok(bytes)
}

fn golden_bytes(golden: &Golden) -> Vec<u8> {
    let tokens = &golden.tokens;
    let before = tokens.uav.iter().chain(&tokens.preference).chain(&tokens.local_map);
    let devices = tokens.devices.iter().chain(std::iter::repeat(&[0.0; DEVICE_FEATURES])).take(K_MAX);
    let mut bytes = le_bytes(before);
    bytes.extend((tokens.devices.len() as u32).to_le_bytes());
    bytes.extend(le_bytes(devices.flatten().chain(&golden.logits)));
    bytes
}

fn le_bytes<'n>(numbers: impl IntoIterator<Item = &'n f32>) -> Vec<u8> {
    numbers.into_iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// Finds a graph with other activations, whose weights would look the same. The golden pairs find every other change.
fn check_operators(graph: &GraphProto) -> Result<(), ConvertError> {
    let linear = 4 + 4 * LAYERS + 2;
    let counted =
        [("Gemm", linear), ("Softmax", LAYERS), ("LayerNormalization", 2 * LAYERS), ("Relu", LAYERS + 1)];
    for (operator, expected) in counted {
        let found = graph.node.iter().filter(|node| node.op_type == operator).count();
        if found != expected {
            return Err(ConvertError::Graph { operator, found, expected });
        }
    }
    Ok(())
}

fn padded<const N: usize>(what: &'static str, text: &str) -> Result<[u8; N], ConvertError> {
    let mut bytes = [0; N];
    match bytes.get_mut(..text.len()) {
        Some(place) => place.copy_from_slice(text.as_bytes()),
        None => return Err(ConvertError::TooLong { what, text: text.into(), room: N }),
    }
    Ok(bytes)
}

struct Writer<'g> {
    graph: &'g GraphProto,
    format: WeightFormat,
    bytes: Vec<u8>,
}

impl Writer<'_> {
    fn numbers<'n>(&mut self, numbers: impl IntoIterator<Item = &'n f32>) {
        self.bytes.append(&mut le_bytes(numbers));
    }

    /// All weights, in the order of `network::Network`.
    fn network(&mut self) -> Result<(), ConvertError> {
        let projectors = [
            ("project_uav", UAV_FEATURES),
            ("project_preference", PREFERENCE_FEATURES),
            ("project_map", LOCAL_MAP_CELLS),
            ("project_device", DEVICE_FEATURES),
        ];
        for (name, inputs) in projectors {
            let layer = self.layer(name, WIDTH, inputs)?;
            self.linear(&layer);
        }
        for encoder in 0..LAYERS {
            self.encoder(&format!("encoder.{encoder}"))?;
        }
        let head = self.layer("head.0", HEAD_HIDDEN, HEAD_INPUTS)?;
        self.linear(&head);
        let mut logits = self.layer("head.1", Action::COUNT, HEAD_HIDDEN)?;
        logits.pad(LOGIT_PANELS * PANEL);
        self.linear(&logits);
        Ok(())
    }

    fn encoder(&mut self, encoder: &str) -> Result<(), ConvertError> {
        let name = |part: &str| format!("{encoder}.{part}");
        let mut query = self.layer(&name("qkv"), 3 * WIDTH, WIDTH)?;
        let key_value = query.split_off(WIDTH);
        // A power of two: exact.
        query.multiply(1.0 / (HEAD_WIDTH as f32).sqrt());
        self.linear(&query);
        self.linear(&key_value);
        let out = self.layer(&name("out"), WIDTH, WIDTH)?;
        self.linear(&out);
        self.norm(&name("norm1"))?;
        let ff1 = self.layer(&name("ff1"), FEED_FORWARD, WIDTH)?;
        self.linear(&ff1);
        let ff2 = self.layer(&name("ff2"), WIDTH, FEED_FORWARD)?;
        self.linear(&ff2);
        self.norm(&name("norm2"))
    }

    fn norm(&mut self, name: &str) -> Result<(), ConvertError> {
        let gain = self.tensor(&format!("{name}.weight"), WIDTH, 1)?;
        let bias = self.tensor(&format!("{name}.bias"), WIDTH, 1)?;
        self.numbers(gain.iter().chain(&bias));
        Ok(())
    }

    fn layer(&self, name: &str, outputs: usize, inputs: usize) -> Result<Layer, ConvertError> {
        Ok(Layer {
            inputs,
            weight: self.tensor(&format!("{name}.weight"), outputs, inputs)?,
            bias: self.tensor(&format!("{name}.bias"), outputs, 1)?,
        })
    }

    fn tensor(&self, name: &str, rows: usize, columns: usize) -> Result<Vec<f32>, ConvertError> {
        let missing = || ConvertError::Weight { name: name.into(), rows, columns };
        let is_it = |tensor: &&TensorProto| {
            let length: i64 = tensor.dims.iter().product();
            tensor.name == name
                && tensor.data_type == DataType::Float as i32
                && tensor.dims.first() == Some(&(rows as i64))
                && length == (rows * columns) as i64
        };
        let tensor = self.graph.initializer.iter().find(is_it).ok_or_else(missing)?;
        let (numbers, rest) = tensor.raw_data.as_chunks::<4>();
        if numbers.len() != rows * columns || !rest.is_empty() {
            return Err(missing());
        }
        Ok(numbers.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect())
    }

    /// Scales, biases, weights in panels.
    fn linear(&mut self, layer: &Layer) {
        let scales = match self.format {
            WeightFormat::F32 => vec![1.0; layer.bias.len()],
            WeightFormat::I16 => layer.scales(f32::from(i16::MAX)),
        };
        if self.format != WeightFormat::F32 {
            self.numbers(&scales);
        }
        self.numbers(&layer.bias);
        let (scales, _) = scales.as_chunks::<PANEL>();
        for (panel, scales) in layer.weight.chunks_exact(PANEL * layer.inputs).zip(scales) {
            for input in 0..layer.inputs {
                let mut column = panel.iter().skip(input).step_by(layer.inputs);
                self.column(scales.map(|scale| column.next().map_or(0.0, |weight| weight / scale)));
            }
        }
    }

    /// The weights of one input in one panel, divided by their scales.
    fn column(&mut self, weights: [f32; PANEL]) {
        match self.format {
            WeightFormat::F32 => self.numbers(&weights),
            WeightFormat::I16 => {
                self.bytes.extend(weights.iter().flat_map(|weight| (weight.round() as i16).to_le_bytes()))
            }
        }
    }
}

/// `y = x W^T + b`, with the weight row by row.
struct Layer {
    inputs: usize,
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl Layer {
    /// Removes and returns the outputs from `outputs` on.
    fn split_off(&mut self, outputs: usize) -> Layer {
        let (weight, bias) = (self.weight.split_off(outputs * self.inputs), self.bias.split_off(outputs));
        Layer { inputs: self.inputs, weight, bias }
    }

    /// A scale for each output that maps its largest weight to the largest code.
    fn scales(&self, largest_code: f32) -> Vec<f32> {
        let largest = |row: &[f32]| row.iter().fold(0.0, |largest, weight| f32::max(largest, weight.abs()));
        let scale = |largest: f32| if largest > 0.0 { largest / largest_code } else { 1.0 };
        self.weight.chunks_exact(self.inputs).map(|row| scale(largest(row))).collect()
    }

    fn multiply(&mut self, factor: f32) {
        self.weight.iter_mut().chain(&mut self.bias).for_each(|number| *number *= factor);
    }

    /// Appends outputs that are zero, up to `outputs`.
    fn pad(&mut self, outputs: usize) {
        self.weight.resize(outputs * self.inputs, 0.0);
        self.bias.resize(outputs, 0.0);
    }
}
