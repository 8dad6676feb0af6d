//! The model's weights, composed and repacked for vector registers.

use super::numbers::Numbers;
use crate::native::model::{self, Model};
use crate::native::network::{self, Network, Stored};
use crate::native::shape::{PANEL, WIDTH};

/// Vectors of a panel: its outputs are `VECTORS` times the lanes of a register.
pub(super) const VECTORS: usize = 2;

/// A linear layer in panels: `[panels][inputs][VECTORS * lanes]`. Outputs are padded with zeros to whole panels.
pub(super) struct Packed {
    pub inputs: usize,
    pub bias: Numbers,
    pub weights: Numbers,
}

impl Packed {
    /// `outputs` rounded up to whole panels.
    pub const fn padded(outputs: usize, lanes: usize) -> usize {
        outputs.next_multiple_of(VECTORS * lanes)
    }

    /// Outputs with padding.
    pub fn outputs(&self) -> usize {
        self.bias.all().len()
    }

    fn new(layer: &Dense, lanes: usize) -> Packed {
        let width = VECTORS * lanes;
        let outputs = Packed::padded(layer.bias.len(), lanes);
        let mut bias = Numbers::zeros(outputs);
        for (place, number) in bias.all_mut().iter_mut().zip(&layer.bias) {
            *place = *number as f32;
        }
        let mut weights = Numbers::zeros(outputs * layer.inputs);
        let panels = weights.all_mut().chunks_exact_mut(layer.inputs * width);
        for (panel, rows) in panels.zip(layer.weight.chunks(layer.inputs * width)) {
            for (output, row) in rows.chunks_exact(layer.inputs).enumerate() {
                for (places, weight) in panel.chunks_exact_mut(width).zip(row) {
                    if let Some(place) = places.get_mut(output) {
                        *place = *weight as f32;
                    }
                }
            }
        }
        Packed { inputs: layer.inputs, bias, weights }
    }
}

/// Gain and bias of a layer norm.
pub(super) struct Norm {
    pub gain: Numbers,
    pub bias: Numbers,
}

impl Norm {
    fn new(norm: &network::Norm<'_>) -> Norm {
        let copy = |from: &[f32; WIDTH]| {
            let mut numbers = Numbers::zeros(WIDTH);
            numbers.all_mut().copy_from_slice(from);
            numbers
        };
        Norm { gain: copy(norm.gain), bias: copy(norm.bias) }
    }
}

/// One encoder layer.
pub(super) struct Encoder {
    pub qkv: Packed,
    pub out: Packed,
    pub norm1: Norm,
    pub ff1: Packed,
    pub ff2: Packed,
    pub norm2: Norm,
}

/// The whole network. Each kind of token has two layers: its projection, and that composed with the first layer's query,
/// key and value.
pub(super) struct Weights {
    /// Lanes of the registers that the weights are packed for.
    pub lanes: usize,
    pub uav: [Packed; 2],
    pub preference: [Packed; 2],
    pub map: [Packed; 2],
    pub device: [Packed; 2],
    pub encoder: [Encoder; 2],
    pub head: Packed,
    pub logits: Packed,
}

impl Weights {
    pub fn new(model: &Model<'_>, lanes: usize) -> Weights {
        match &model.weights {
            model::Weights::F32(network) => Weights::pack(network, lanes),
            model::Weights::I16(network) => Weights::pack(network, lanes),
        }
    }

    fn pack<W: Stored>(network: &Network<'_, W>, lanes: usize) -> Weights {
        let [first, last] = &network.encoder;
        let qkv = [first, last].map(|layer| Dense::new(&layer.query).beside(Dense::new(&layer.key_value)));
        let token = |projection: Dense| {
            let [first, _] = &qkv;
            [Packed::new(&projection, lanes), Packed::new(&first.after(&projection), lanes)]
        };
        let packed = |layer: Dense| Packed::new(&layer, lanes);
        let encoder = |layer: &network::Encoder<'_, W>, qkv: &Dense| Encoder {
            qkv: Packed::new(qkv, lanes),
            out: packed(Dense::new(&layer.out)),
            norm1: Norm::new(&layer.norm1),
            ff1: packed(Dense::new(&layer.ff1)),
            ff2: packed(Dense::new(&layer.ff2)),
            norm2: Norm::new(&layer.norm2),
        };
        let [first_qkv, last_qkv] = &qkv;
        Weights {
            lanes,
            uav: token(Dense::new(&network.project_uav)),
            preference: token(Dense::new(&network.project_preference)),
            map: token(Dense::new(&network.project_map)),
            device: token(Dense::new(&network.project_device)),
            encoder: [encoder(first, first_qkv), encoder(last, last_qkv)],
            head: packed(Dense::new(&network.head)),
            logits: packed(Dense::new(&network.logits)),
        }
    }
}

/// A linear layer `y = W x + b` in double precision, `W` row by row.
struct Dense {
    inputs: usize,
    weight: Vec<f64>,
    bias: Vec<f64>,
}

impl Dense {
    fn new<W: Stored, const INPUTS: usize, const PANELS: usize>(
        layer: &network::Linear<'_, W, INPUTS, PANELS>,
    ) -> Dense {
        let mut weight = Vec::with_capacity(PANELS * PANEL * INPUTS);
        for (panel, scale) in layer.weight.iter().zip(layer.scale) {
            for (output, scale) in scale.iter().enumerate() {
                weight.extend(panel.iter().map(|weights| {
                    let weights = weights.widen();
                    f64::from(weights.get(output).copied().unwrap_or_default()) * f64::from(*scale)
                }));
            }
        }
        let bias = layer.bias.as_flattened().iter().copied().map(f64::from).collect();
        Dense { inputs: INPUTS, weight, bias }
    }

    /// Both layers on the same input: the outputs of `other` after these.
    fn beside(mut self, other: Dense) -> Dense {
        self.weight.extend(other.weight);
        self.bias.extend(other.bias);
        self
    }

    /// This layer applied to the output of `inner`.
    fn after(&self, inner: &Dense) -> Dense {
        let mut composed = Dense { inputs: inner.inputs, weight: Vec::new(), bias: Vec::new() };
        for (row, bias) in self.weight.chunks_exact(self.inputs).zip(&self.bias) {
            let mut outer = vec![0.0; inner.inputs];
            let mut sum = *bias;
            for ((weight, inner_row), inner_bias) in
                row.iter().zip(inner.weight.chunks_exact(inner.inputs)).zip(&inner.bias)
            {
                sum += weight * inner_bias;
                for (outer, inner) in outer.iter_mut().zip(inner_row) {
                    *outer += weight * inner;
                }
            }
            composed.weight.extend(outer);
            composed.bias.push(sum);
        }
        composed
    }
}
