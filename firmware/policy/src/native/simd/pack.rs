//! The model's weights, repacked for vector registers.

use super::numbers::Numbers;
use crate::native::model::{self, Model};
use crate::native::network::{self, Network, Stored};
use crate::native::shape::{PANEL, WIDTH};

/// Vectors of a panel: its outputs are `VECTORS` times the lanes of a register.
pub(super) const VECTORS: usize = 2;

/// A linear layer in panels: `[panels][inputs][VECTORS * lanes]`. Outputs are padded with zeros to whole panels.
pub(super) struct Packed {
    pub inputs: usize,
    /// Of each output; 1 for 32-bit weights.
    pub scale: Numbers,
    pub bias: Numbers,
    /// Before the scale.
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
        let (mut scale, mut bias) = (Numbers::zeros(outputs), Numbers::zeros(outputs));
        scale.first_mut(layer.scale.len()).copy_from_slice(&layer.scale);
        bias.first_mut(layer.bias.len()).copy_from_slice(&layer.bias);
        let mut weights = Numbers::zeros(outputs * layer.inputs);
        let panels = weights.all_mut().chunks_exact_mut(layer.inputs * width);
        for (panel, rows) in panels.zip(layer.weight.chunks(layer.inputs * width)) {
            for (output, row) in rows.chunks_exact(layer.inputs).enumerate() {
                for (places, weight) in panel.chunks_exact_mut(width).zip(row) {
                    if let Some(place) = places.get_mut(output) {
                        *place = *weight;
                    }
                }
            }
        }
        Packed { inputs: layer.inputs, scale, bias, weights }
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

/// The whole network.
pub(super) struct Weights {
    /// Lanes of the registers that the weights are packed for.
    pub lanes: usize,
    pub uav: Packed,
    pub preference: Packed,
    pub map: Packed,
    pub device: Packed,
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
        let packed = |layer: Dense| Packed::new(&layer, lanes);
        let encoder = |layer: &network::Encoder<'_, W>| Encoder {
            qkv: packed(Dense::new(&layer.query).beside(Dense::new(&layer.key_value))),
            out: packed(Dense::new(&layer.out)),
            norm1: Norm::new(&layer.norm1),
            ff1: packed(Dense::new(&layer.ff1)),
            ff2: packed(Dense::new(&layer.ff2)),
            norm2: Norm::new(&layer.norm2),
        };
        let [first, last] = &network.encoder;
        Weights {
            lanes,
            uav: packed(Dense::new(&network.project_uav)),
            preference: packed(Dense::new(&network.project_preference)),
            map: packed(Dense::new(&network.project_map)),
            device: packed(Dense::new(&network.project_device)),
            encoder: [encoder(first), encoder(last)],
            head: packed(Dense::new(&network.head)),
            logits: packed(Dense::new(&network.logits)),
        }
    }
}

/// A linear layer `y = scale W x + b`, `W` row by row.
struct Dense {
    inputs: usize,
    weight: Vec<f32>,
    scale: Vec<f32>,
    bias: Vec<f32>,
}

impl Dense {
    fn new<W: Stored, const INPUTS: usize, const PANELS: usize>(
        layer: &network::Linear<'_, W, INPUTS, PANELS>,
    ) -> Dense {
        let mut weight = Vec::with_capacity(PANELS * PANEL * INPUTS);
        for panel in layer.weight {
            for output in 0..PANEL {
                let weights = panel.iter().map(|weights| weights.widen());
                weight.extend(weights.map(|weights| weights.get(output).copied().unwrap_or_default()));
            }
        }
        let [scale, bias] = [layer.scale, layer.bias].map(|numbers| numbers.as_flattened().to_vec());
        Dense { inputs: INPUTS, weight, scale, bias }
    }

    /// Both layers on the same input: the outputs of `other` after these.
    fn beside(mut self, other: Dense) -> Dense {
        self.weight.extend(other.weight);
        self.scale.extend(other.scale);
        self.bias.extend(other.bias);
        self
    }
}
