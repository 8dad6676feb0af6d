//! The sizes of the network, and the place of each tensor in the flat parameter vector.

use gleaner_policy::schema;
use rand::{Rng, RngExt};

/// Width of a token, and of the encoder's input and output.
pub const WIDTH: usize = 64;
/// Attention heads per layer.
pub const HEADS: usize = 4;
/// Width of one head.
pub const HEAD_WIDTH: usize = WIDTH / HEADS;
/// Encoder layers.
pub const LAYERS: usize = 2;
/// Most devices in a sample: K_max of the observation contract.
pub const DEVICES_MAX: usize = gleaner_policy::K_MAX;
/// Tokens that every sample has: UAV, preference and local map, in this order.
pub const FIXED_TOKENS: usize = 3;
/// Tokens of a sample with every device present.
pub const TOKENS_MAX: usize = FIXED_TOKENS + DEVICES_MAX;
/// Features of the UAV token.
pub const UAV_FEATURES: usize = schema::UAV_FEATURES;
/// Features of one device token of the shipped policy.
pub const DEVICE_FEATURES: usize = schema::DEVICE_FEATURES;
/// Features of the preference token.
pub const PREFERENCE_FEATURES: usize = schema::PREFERENCE_FEATURES;
/// Numbers of the local map of the shipped policy.
pub const MAP_CELLS: usize = gleaner_policy::LOCAL_MAP_CELLS;
/// Inputs of the head: UAV, preference, map and the pooled devices.
pub const HEAD_INPUTS: usize = 4 * WIDTH;
/// Added to the variance in every layer norm.
pub const LAYER_NORM_EPSILON: f32 = 1e-5;

/// The sizes that differ between networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Shape {
    /// Numbers of the local map.
    pub map_cells: usize,
    /// Features of one device.
    pub device_features: usize,
    /// Hidden width of the feed-forward block of each encoder layer.
    pub feed_forward: usize,
    /// Hidden width of the head.
    pub head: usize,
    /// Outputs: logits of the actor; for a critic, actions x objectives, action-major.
    pub outputs: usize,
}

/// One tensor in the flat vector, stored row by row as in PyTorch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tensor {
    /// Dotted name, e.g. `encoder.0.qkv.weight`.
    pub name: String,
    /// Index of the first number in the flat vector.
    pub offset: usize,
    /// Outputs of a weight matrix; the length of a bias or of a gain.
    pub rows: usize,
    /// Inputs of a weight matrix; 1 for a bias or a gain.
    pub cols: usize,
}

impl Tensor {
    /// Numbers in the tensor.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows * self.cols
    }

    /// Whether it has no numbers; never true for a tensor of a [`Shape`].
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The tensor's numbers in the flat vector.
    #[must_use]
    pub fn of<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.offset..self.offset + self.len()]
    }
}

/// Place of a linear layer `y = x W^T + b`: the weight `[outputs, inputs]`, then the bias if it has one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linear {
    /// Its index among the layers of its network.
    pub index: usize,
    pub offset: usize,
    pub inputs: usize,
    pub outputs: usize,
    pub biased: bool,
}

/// Assigns consecutive places to linear layers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ruler {
    /// Numbers so far.
    pub len: usize,
    /// Layers so far.
    pub count: usize,
}

impl Ruler {
    pub fn linear(&mut self, inputs: usize, outputs: usize) -> Linear {
        self.lay(inputs, outputs, true)
    }

    pub fn unbiased(&mut self, inputs: usize, outputs: usize) -> Linear {
        self.lay(inputs, outputs, false)
    }

    fn lay(&mut self, inputs: usize, outputs: usize, biased: bool) -> Linear {
        let linear = Linear { index: self.count, offset: self.len, inputs, outputs, biased };
        self.len += (inputs + usize::from(biased)) * outputs;
        self.count += 1;
        linear
    }
}

impl Linear {
    pub fn weight<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.offset..self.offset + self.inputs * self.outputs]
    }

    pub fn bias<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        let start = self.offset + self.inputs * self.outputs;
        &parameters[start..start + if self.biased { self.outputs } else { 0 }]
    }

    /// The tensors of a layer with this name.
    pub fn tensors(&self, name: &str) -> Vec<Tensor> {
        let (rows, cols) = (self.outputs, self.inputs);
        let weight = Tensor { name: format!("{name}.weight"), offset: self.offset, rows, cols };
        let bias = Tensor { name: format!("{name}.bias"), offset: self.offset + rows * cols, rows, cols: 1 };
        if self.biased { vec![weight, bias] } else { vec![weight] }
    }

    /// Draws weight and bias with PyTorch's default: uniform in +-1/sqrt(inputs) (Kaiming uniform with a = sqrt 5). Where
    /// the sum of two layers forms one layer, `inputs` counts the inputs of both.
    pub fn initialise(&self, inputs: usize, parameters: &mut [f32], rng: &mut impl Rng) {
        let bound = 1.0 / (inputs as f32).sqrt();
        let (weight, bias) = self.split_mut(parameters);
        for value in weight.iter_mut().chain(bias) {
            *value = bound * (2.0 * rng.random::<f32>() - 1.0);
        }
    }

    /// Weight and bias in a vector of gradients.
    pub fn split_mut<'a>(&self, gradients: &'a mut [f32]) -> (&'a mut [f32], &'a mut [f32]) {
        let weights = self.inputs * self.outputs;
        let biases = if self.biased { self.outputs } else { 0 };
        gradients[self.offset..self.offset + weights + biases].split_at_mut(weights)
    }
}

/// Place of a layer norm: the gain, then the bias, each `[WIDTH]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Norm {
    pub offset: usize,
}

impl Norm {
    pub fn gain<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.offset..self.offset + WIDTH]
    }

    pub fn bias<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.offset + WIDTH..self.offset + 2 * WIDTH]
    }

    pub fn split_mut<'a>(&self, gradients: &'a mut [f32]) -> (&'a mut [f32], &'a mut [f32]) {
        gradients[self.offset..self.offset + 2 * WIDTH].split_at_mut(WIDTH)
    }
}

/// Places of one encoder layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct EncoderLayout {
    pub qkv: Linear,
    pub out: Linear,
    pub norm1: Norm,
    pub ff1: Linear,
    pub ff2: Linear,
    pub norm2: Norm,
}

/// Places of all layers, in the order of the flat vector.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub project_uav: Linear,
    pub project_preference: Linear,
    pub project_map: Linear,
    pub project_device: Linear,
    pub encoder: [EncoderLayout; LAYERS],
    pub head: [Linear; 2],
    pub len: usize,
}

impl Layout {
    pub fn new(shape: Shape) -> Self {
        let mut ruler = Ruler::default();
        let mut linear = |inputs, outputs| ruler.linear(inputs, outputs);
        let project_uav = linear(UAV_FEATURES, WIDTH);
        let project_preference = linear(PREFERENCE_FEATURES, WIDTH);
        let project_map = linear(shape.map_cells, WIDTH);
        let project_device = linear(shape.device_features, WIDTH);
        let encoder = std::array::from_fn(|_| {
            // A norm has the length of a linear layer with one input.
            let qkv = linear(WIDTH, 3 * WIDTH);
            let out = linear(WIDTH, WIDTH);
            let norm1 = Norm { offset: linear(1, WIDTH).offset };
            let ff1 = linear(WIDTH, shape.feed_forward);
            let ff2 = linear(shape.feed_forward, WIDTH);
            let norm2 = Norm { offset: linear(1, WIDTH).offset };
            EncoderLayout { qkv, out, norm1, ff1, ff2, norm2 }
        });
        let head = [linear(HEAD_INPUTS, shape.head), linear(shape.head, shape.outputs)];
        Self { project_uav, project_preference, project_map, project_device, encoder, head, len: ruler.len }
    }

    /// The linear layers in the order of the flat vector.
    pub fn linears(&self) -> impl Iterator<Item = Linear> {
        let layers = self.encoder.into_iter().flat_map(|layer| [layer.qkv, layer.out, layer.ff1, layer.ff2]);
        [self.project_uav, self.project_preference, self.project_map, self.project_device]
            .into_iter()
            .chain(layers)
            .chain(self.head)
    }

    /// The linear layers with their names, in the order of the flat vector.
    fn named_linears(&self) -> impl Iterator<Item = (String, Linear)> {
        let projectors = ["uav", "preference", "map", "device"].map(|name| format!("project_{name}"));
        let layers = (0..LAYERS)
            .flat_map(|layer| ["qkv", "out", "ff1", "ff2"].map(|name| format!("encoder.{layer}.{name}")));
        let head = [0, 1].map(|index| format!("head.{index}"));
        projectors.into_iter().chain(layers).chain(head).zip(self.linears())
    }

    fn norms(&self) -> Vec<(String, Norm)> {
        let mut list = Vec::new();
        for (index, layer) in self.encoder.iter().enumerate() {
            list.push((format!("encoder.{index}.norm1"), layer.norm1));
            list.push((format!("encoder.{index}.norm2"), layer.norm2));
        }
        list
    }
}

impl Shape {
    /// The actor of the shipped policy: five logits, 89,989 parameters.
    #[must_use]
    pub const fn actor() -> Self {
        Self {
            map_cells: MAP_CELLS,
            device_features: DEVICE_FEATURES,
            feed_forward: 128,
            head: 64,
            outputs: 5,
        }
    }

    /// A critic: five actions x two objectives, index `action * 2 + objective`.
    #[must_use]
    pub const fn critic() -> Self {
        Self { outputs: 10, ..Self::actor() }
    }

    /// The network of the paper's text: 10 x 10 cells of buildings, five numbers a device, a head of 128; 107,845
    /// parameters with five outputs.
    #[must_use]
    pub const fn paper(outputs: usize) -> Self {
        Self { map_cells: 100, device_features: 5, feed_forward: 128, head: 128, outputs }
    }

    /// Length of the flat parameter vector.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        Layout::new(*self).len
    }

    /// Every tensor in the order of the flat vector, without gaps.
    #[must_use]
    pub fn tensors(&self) -> Vec<Tensor> {
        let layout = Layout::new(*self);
        let mut tensors = Vec::new();
        for (name, linear) in layout.named_linears() {
            tensors.extend(linear.tensors(&name));
        }
        for (name, norm) in layout.norms() {
            for (part, offset) in [("weight", norm.offset), ("bias", norm.offset + WIDTH)] {
                tensors.push(Tensor { name: format!("{name}.{part}"), offset, rows: WIDTH, cols: 1 });
            }
        }
        tensors.sort_by_key(|tensor| tensor.offset);
        tensors
    }

    /// Random initial parameters with PyTorch's defaults; gains 1, norm biases 0.
    #[must_use]
    pub fn initialise(&self, rng: &mut impl Rng) -> Vec<f32> {
        let layout = Layout::new(*self);
        let mut parameters = vec![0.0; layout.len];
        for linear in layout.linears() {
            linear.initialise(linear.inputs, &mut parameters, rng);
        }
        for (_, norm) in layout.norms() {
            norm.split_mut(&mut parameters).0.fill(1.0);
        }
        parameters
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_tile_the_flat_vector() {
        for shape in [Shape::actor(), Shape::critic(), Shape::paper(5)] {
            let mut next = 0;
            for tensor in shape.tensors() {
                assert_eq!(tensor.offset, next, "{}", tensor.name);
                next += tensor.len();
            }
            assert_eq!(next, shape.parameter_count());
        }
        assert_eq!(Shape::actor().parameter_count(), 89_989);
        assert_eq!(Shape::critic().parameter_count(), 90_314);
        assert_eq!(Shape::paper(5).parameter_count(), 107_845);
    }
}
