//! The convolutional network on centred maps (paper, MOSAC-CGL and DDQN-CGL; after Theile et al. 2021).
//!
//! ```text
//! local 10 x 10 x 4 ──► conv 5x5x16 relu ─► 6 x 6 ──► conv 5x5x16 relu ─► 2 x 2 ──► 64 ┐
//! global 15 x 11 x 4 ─► conv 5x5x16 relu ─► 11 x 7 ─► conv 5x5x16 relu ─► 7 x 3 ─► 336 ├► 401 ┐
//! battery ─────────────────────────────────────────────────────────────────────────► 1 ┘      ├► head
//! preference ────────────────────────────────────────────────────────────────────────────► 2 ┘
//! ```

use super::architecture::{Architecture, Samples};
use super::convolution::{Convolution, ConvolutionMemory};
use super::features::chunks;
use super::head::{HeadLayout, HeadMemory, Preferences};
use super::matrix::{CutWeights, Panels};
use super::shape::{Linear, PREFERENCE_FEATURES, Ruler, Tensor};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

/// Layers of a map: heights, zones, remaining data, the UAV (paper, section III-C).
pub const MAP_CHANNELS: usize = 4;
/// Cells along both sides of the local map (paper, l).
pub const LOCAL_SIDE: usize = 10;
/// Width and height of the global map in windows: a 40 x 30 grid centred on any of its cells spans 79 x 59 cells,
/// which hold 15 x 11 windows of [`GLOBAL_WINDOW`].
pub const GLOBAL_SIZE: (usize, usize) = (15, 11);
/// Cells along a side of a window that is averaged into one cell of the global map (paper, g).
pub const GLOBAL_WINDOW: usize = 5;
/// Filters of each convolution.
const FILTERS: usize = 16;
/// Convolutions in sequence.
const DEPTH: usize = 2;
/// States that are computed together: their patches fit into the second-level cache.
const CHUNK: usize = 8;

/// Numbers of a local map.
pub const LOCAL_NUMBERS: usize = LOCAL_SIDE * LOCAL_SIDE * MAP_CHANNELS;
/// Numbers of a global map.
pub const GLOBAL_NUMBERS: usize = GLOBAL_SIZE.0 * GLOBAL_SIZE.1 * MAP_CHANNELS;

/// The network. Its fixed sizes are constants of this module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapShape {
    /// Outputs per sample.
    pub outputs: usize,
}

/// States under preferences. The layout of maps is `[height][width][channels]`, row by row from the south-west.
#[derive(Clone, Debug, Default)]
pub struct MapBatch {
    local: Vec<f32>,
    global: Vec<f32>,
    /// `[states]`.
    battery: Vec<f32>,
    preferences: Preferences,
}

impl MapBatch {
    /// Appends a state under each of the preferences. Returns its local and its global map, all zeros, for the caller to
    /// draw.
    pub fn push(
        &mut self,
        battery: f32,
        preferences: &[[f32; PREFERENCE_FEATURES]],
    ) -> (&mut [f32; LOCAL_NUMBERS], &mut [f32; GLOBAL_NUMBERS]) {
        self.battery.push(battery);
        self.preferences.push(preferences);
        self.local.resize(self.local.len() + LOCAL_NUMBERS, 0.0);
        self.global.resize(self.global.len() + GLOBAL_NUMBERS, 0.0);
        let maps = (self.local.last_chunk_mut(), self.global.last_chunk_mut());
        let (Some(local), Some(global)) = maps else { unreachable!("both were just appended") };
        (local, global)
    }

    /// The maps of the last state.
    #[must_use]
    pub fn last(&self) -> Option<(&[f32; LOCAL_NUMBERS], &[f32; GLOBAL_NUMBERS])> {
        self.local.last_chunk().zip(self.global.last_chunk())
    }

    fn inputs(&self, states: Range<usize>) -> [&[f32]; 2] {
        let part = |size: usize| states.start * size..states.end * size;
        [&self.local[part(LOCAL_NUMBERS)], &self.global[part(GLOBAL_NUMBERS)]]
    }
}

impl Samples for MapBatch {
    fn clear(&mut self) {
        self.local.clear();
        self.global.clear();
        self.battery.clear();
        self.preferences.clear();
    }
}

/// Places of all layers, in the order of the flat vector.
#[derive(Clone, Copy, Debug)]
struct MapLayout {
    /// Local, then global.
    branches: [[Convolution; DEPTH]; 2],
    head: HeadLayout,
    latent: usize,
    len: usize,
}

impl MapLayout {
    fn new(outputs: usize) -> MapLayout {
        let mut ruler = Ruler::default();
        let branches = [(LOCAL_SIDE, LOCAL_SIDE), GLOBAL_SIZE].map(|size| {
            let first = Convolution::new(&mut ruler, size, MAP_CHANNELS, FILTERS);
            [first, Convolution::new(&mut ruler, first.size_out(), FILTERS, FILTERS)]
        });
        let latent = branches.iter().map(|[_, last]| last.numbers_out()).sum::<usize>() + 1;
        let head = HeadLayout::new(&mut ruler, latent, outputs);
        MapLayout { branches, head, latent, len: ruler.len }
    }

    fn linears(&self) -> impl Iterator<Item = Linear> {
        self.branches.into_iter().flatten().map(|layer| layer.linear).chain(self.head.linears())
    }
}

/// Memory for the passes.
#[derive(Clone, Debug, Default)]
pub struct MapWorkspace {
    forward_weights: CutWeights,
    backward_weights: CutWeights,
    branches: [[ConvolutionMemory; DEPTH]; 2],
    /// `[states, latent]`: local, global, battery.
    latent: Vec<f32>,
    head: HeadMemory,
    panels: Panels,
    outputs: Vec<f32>,
    d_outputs: Vec<f32>,
}

impl MapWorkspace {
    /// Computes both branches of a range of states into `latent`.
    fn forward_maps(
        &mut self,
        layout: &MapLayout,
        parameters: &[f32],
        batch: &MapBatch,
        states: Range<usize>,
    ) {
        let weights = &self.forward_weights;
        for ((layers, memory), maps) in
            layout.branches.iter().zip(&mut self.branches).zip(batch.inputs(states.clone()))
        {
            let [first, second] = memory;
            layers[0].forward(parameters, weights, maps, first);
            layers[1].forward(parameters, weights, &first.out, second);
        }
        self.latent.resize(states.len() * layout.latent, 0.0);
        let rows = self.latent.chunks_exact_mut(layout.latent).zip(&batch.battery[states]);
        let [local, global] = &self.branches;
        let sizes = layout.branches.map(|[_, last]| last.numbers_out());
        let maps = local[1].out.chunks_exact(sizes[0]).zip(global[1].out.chunks_exact(sizes[1]));
        for ((row, &battery), (local, global)) in rows.zip(maps) {
            row[..sizes[0]].copy_from_slice(local);
            row[sizes[0]..sizes[0] + sizes[1]].copy_from_slice(global);
            row[sizes[0] + sizes[1]] = battery;
        }
    }

    /// Backward pass from the gradient with respect to `latent`.
    fn backward_maps(&mut self, layout: &MapLayout, gradients: &mut [f32]) {
        let mut first_number = 0;
        for (layers, memory) in layout.branches.iter().zip(&mut self.branches) {
            let [first, second] = memory;
            let size = layers[1].numbers_out();
            second.d_out.clear();
            for row in self.head.d_state.chunks_exact(layout.latent) {
                second.d_out.extend_from_slice(&row[first_number..first_number + size]);
            }
            first_number += size;
            let weights = &self.backward_weights;
            let (panels, d_maps) = (&mut self.panels, Some(&mut first.d_out));
            layers[1].backward(weights, second, d_maps, (panels, gradients));
            layers[0].backward(weights, first, None, (panels, gradients));
        }
    }
}

impl Architecture for MapShape {
    type Batch = MapBatch;
    type Workspace = MapWorkspace;

    fn with_outputs(outputs: usize) -> MapShape {
        MapShape { outputs }
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn tensors(&self) -> Vec<Tensor> {
        let layout = MapLayout::new(self.outputs);
        let names =
            ["local", "global"].into_iter().flat_map(|map| [0, 1].map(|layer| format!("{map}.{layer}")));
        let layers = layout.branches.iter().flatten();
        let maps = names.zip(layers).flat_map(|(name, layer)| layer.linear.tensors(&name));
        maps.chain(layout.head.tensors()).collect()
    }

    fn initialise(&self, rng: &mut ChaCha8Rng) -> Vec<f32> {
        let layout = MapLayout::new(self.outputs);
        let mut parameters = vec![0.0; layout.len];
        for layer in layout.branches.iter().flatten() {
            layer.linear.initialise(layer.linear.inputs, &mut parameters, rng);
        }
        layout.head.initialise(&mut parameters, rng);
        parameters
    }

    fn forward<'a>(
        &self,
        parameters: &[f32],
        batch: &MapBatch,
        workspace: &'a mut MapWorkspace,
    ) -> &'a [f32] {
        let layout = MapLayout::new(self.outputs);
        assert_eq!(parameters.len(), layout.len, "the flat vector must fit the shape");
        workspace.forward_weights.cut_forward(layout.linears(), parameters);
        let preferences = &batch.preferences;
        workspace.outputs.resize(preferences.samples() * self.outputs, 0.0);
        for states in chunks(preferences.states(), CHUNK) {
            workspace.forward_maps(&layout, parameters, batch, states.clone());
            let MapWorkspace { forward_weights, latent, head, outputs, .. } = &mut *workspace;
            let samples = preferences.of(states.clone());
            let outputs = &mut outputs[samples.start * self.outputs..samples.end * self.outputs];
            head.forward(&layout.head, (parameters, forward_weights), (latent, preferences, states), outputs);
        }
        &workspace.outputs
    }

    fn forward_backward<'a>(
        &self,
        parameters: &[f32],
        batch: &MapBatch,
        workspace: &'a mut MapWorkspace,
        mut loss: impl FnMut(Range<usize>, &[f32], &mut [f32]),
        gradients: &mut [f32],
    ) -> &'a [f32] {
        let layout = MapLayout::new(self.outputs);
        let fits = parameters.len() == layout.len && gradients.len() == layout.len;
        assert!(fits, "the flat vectors must fit the shape");
        workspace.forward_weights.cut_forward(layout.linears(), parameters);
        workspace.backward_weights.cut_backward(layout.linears(), parameters);
        let preferences = &batch.preferences;
        workspace.outputs.resize(preferences.samples() * self.outputs, 0.0);
        for states in chunks(preferences.states(), CHUNK) {
            workspace.forward_maps(&layout, parameters, batch, states.clone());
            let MapWorkspace {
                forward_weights,
                backward_weights,
                latent,
                head,
                panels,
                outputs,
                d_outputs,
                ..
            } = &mut *workspace;
            let samples = preferences.of(states.clone());
            let outputs = &mut outputs[samples.start * self.outputs..samples.end * self.outputs];
            let input = (&latent[..], preferences, states);
            head.forward(&layout.head, (parameters, forward_weights), input.clone(), outputs);
            d_outputs.resize(outputs.len(), 0.0);
            loss(samples, outputs, d_outputs);
            head.backward(&layout.head, backward_weights, input, (d_outputs, true), (panels, gradients));
            workspace.backward_maps(&layout, gradients);
        }
        &workspace.outputs
    }
}
