//! The forward pass of the portable engine.

use super::attention::{KeyValue, Weights as HeadWeights, add_mean, attend, blocks};
use super::kernel::multiply;
use super::model::{Model, Weights};
use super::network::{Encoder, Linear, Network, Stored};
use super::rowwise::{add_and_norm, rectify};
use super::shape::{
    BLOCKS, Block, FEED_FORWARD, HEAD_HIDDEN, HEAD_INPUTS, LANES, LOGIT_PANELS, PANEL, WIDTH, WIDTH_PANELS,
};
use crate::schema::{
    self, DEVICE_FEATURES, DEVICE_NORMALISATIONS, Normalisation, PREFERENCE_NORMALISATIONS,
    UAV_NORMALISATIONS,
};
use crate::{Attention, FIRST_DEVICE_TOKEN, Inference, LOCAL_MAP_CELLS, Policy, TOKENS, Tokens};
use core::array;
use core::fmt;
use gleaner_units::Action;

/// Memory for the activations, about 17 kB, reused by every inference.
#[derive(Clone, Debug)]
pub struct Workspace {
    tokens: [Block<WIDTH>; BLOCKS],
    key_value: [KeyValue; BLOCKS],
    query: Block<WIDTH>,
    mixed: Block<WIDTH>,
    hidden: Block<FEED_FORWARD>,
    head_weights: HeadWeights,
    attention: Attention,
}

impl Workspace {
    /// An empty workspace; `const`, so that it can be a `static`.
    #[must_use]
    pub const fn new() -> Workspace {
        Workspace {
            tokens: [[[0.0; LANES]; WIDTH]; BLOCKS],
            key_value: [[[0.0; LANES]; 2 * WIDTH]; BLOCKS],
            query: [[0.0; LANES]; WIDTH],
            mixed: [[0.0; LANES]; WIDTH],
            hidden: [[0.0; LANES]; FEED_FORWARD],
            head_weights: [[[0.0; LANES]; LANES]; BLOCKS],
            attention: Attention::NONE,
        }
    }
}

impl Default for Workspace {
    fn default() -> Workspace {
        Workspace::new()
    }
}

/// Why an inference failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NativeError {
    /// The local map is incomplete.
    LocalMap {
        /// Its cells.
        cells: usize,
    },
    /// An output is infinite or not a number.
    NotFinite,
}

impl fmt::Display for NativeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NativeError::LocalMap { cells } => {
                write!(f, "the local map has {cells} cells, not {LOCAL_MAP_CELLS}")
            }
            NativeError::NotFinite => write!(f, "an output of the model is not finite"),
        }
    }
}

impl core::error::Error for NativeError {}

/// The portable engine with a model: one observation at a time, the same bits on every machine.
pub struct NativePolicy<'m> {
    model: Model<'m>,
    workspace: &'m mut Workspace,
}

impl<'m> NativePolicy<'m> {
    /// An engine for `model`. Run [`crate::self_test`] before flying with it.
    #[must_use]
    pub fn new(model: Model<'m>, workspace: &'m mut Workspace) -> NativePolicy<'m> {
        NativePolicy { model, workspace }
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> &Model<'m> {
        &self.model
    }
}

impl Policy for NativePolicy<'_> {
    type Error = NativeError;

    /// # Cost
    /// About 0.66 million multiply-adds with six devices, 1.07 million with twelve. No allocation, no recursion.
    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, NativeError> {
        let cells = tokens.local_map.len();
        let map = <[f32; LOCAL_MAP_CELLS]>::try_from(tokens.local_map.as_slice());
        let map = map.map_err(|_| NativeError::LocalMap { cells })?;
        let logits = match &self.model.weights {
            Weights::F32(network) => self.workspace.run(network, tokens, &map),
            Weights::I16(network) => self.workspace.run(network, tokens, &map),
        };
        let inference = Inference { logits, attention: self.workspace.attention.clone() };
        let attention = inference.attention.0.as_flattened();
        if inference.logits.iter().chain(attention).all(|number| number.is_finite()) {
            Ok(inference)
        } else {
            Err(NativeError::NotFinite)
        }
    }
}

impl Workspace {
    fn run<W: Stored>(
        &mut self,
        network: &Network<'_, W>,
        tokens: &Tokens,
        map: &[f32; LOCAL_MAP_CELLS],
    ) -> [f32; Action::COUNT] {
        let present = FIRST_DEVICE_TOKEN.saturating_add(tokens.devices.len()).min(TOKENS);
        self.attention = Attention::NONE;
        self.embed(network, tokens, map);
        let [first, last] = &network.encoder;
        self.encode(first, present, false);
        self.encode(last, present, true);
        let joined = self.join(present);
        let mut hidden = [[0.0]; HEAD_HIDDEN];
        multiply(&network.head, &joined, &mut hidden);
        rectify(&mut hidden);
        let mut logits = [[0.0]; LOGIT_PANELS * PANEL];
        multiply(&network.logits, &hidden, &mut logits);
        let mut logits = logits.iter().map(|[logit]| *logit);
        array::from_fn(|_| logits.next().unwrap_or(f32::NAN))
    }

    /// Normalises and projects each token into its lane.
    fn embed<W: Stored>(&mut self, network: &Network<'_, W>, tokens: &Tokens, map: &[f32; LOCAL_MAP_CELLS]) {
        let mut devices = [[0.0; DEVICE_FEATURES]; FIRST_DEVICE_TOKEN]
            .into_iter()
            .chain(tokens.devices.iter().map(|device| normalise(device, &DEVICE_NORMALISATIONS)));
        let present = FIRST_DEVICE_TOKEN.saturating_add(tokens.devices.len());
        for block in self.tokens.iter_mut().take(blocks(present)) {
            let mut features = [[0.0; LANES]; DEVICE_FEATURES];
            for lane in 0..LANES {
                if let Some(device) = devices.next() {
                    put(&mut features, lane, device);
                }
            }
            multiply(&network.project_device, &features, block);
        }
        let [first, ..] = &mut self.tokens;
        put(first, 0, project(&network.project_uav, &normalise(&tokens.uav, &UAV_NORMALISATIONS)));
        put(
            first,
            1,
            project(&network.project_preference, &normalise(&tokens.preference, &PREFERENCE_NORMALISATIONS)),
        );
        put(first, 2, project(&network.project_map, &map.map(|units| schema::YIELD.apply(units))));
    }

    /// One encoder layer: `x = norm(x + attention(x))`, `x = norm(x + ff(x))`, block by block.
    fn encode<W: Stored>(&mut self, layer: &Encoder<'_, W>, present: usize, explain: bool) {
        let Workspace { tokens, key_value, query, mixed, hidden, head_weights, attention } = self;
        for (block, key_value) in tokens.iter().zip(key_value.iter_mut()).take(blocks(present)) {
            multiply(&layer.key_value, block, key_value);
        }
        for (index, block) in (0..BLOCKS).zip(tokens.iter_mut()).take(blocks(present)) {
            multiply(&layer.query, block, query);
            attend(query, key_value, present, head_weights, mixed, |weights| {
                if explain {
                    add_mean(attention, index, present, weights);
                }
            });
            multiply(&layer.out, mixed, query);
            add_and_norm(&layer.norm1, block, query);
            multiply(&layer.ff1, block, hidden);
            rectify(hidden);
            multiply(&layer.ff2, hidden, mixed);
            add_and_norm(&layer.norm2, block, mixed);
        }
    }

    /// The head's inputs: aircraft, preference, map, and the maximum of each device feature (zero without devices).
    fn join(&self, present: usize) -> [[f32; 1]; HEAD_INPUTS] {
        let mut joined = [[0.0]; HEAD_INPUTS];
        let (parts, _) = joined.as_chunks_mut::<WIDTH>();
        let ([first, ..], [uav, preference, map, pooled]) = (&self.tokens, parts) else { return joined };
        for ((([uav_lane, preference_lane, map_lane, ..], uav), preference), map) in
            first.iter().zip(uav).zip(preference).zip(map)
        {
            (*uav, *preference, *map) = ([*uav_lane], [*preference_lane], [*map_lane]);
        }
        let devices = present.saturating_sub(FIRST_DEVICE_TOKEN);
        if devices > 0 {
            *pooled = [[f32::MIN]; WIDTH];
        }
        let mut lanes = (FIRST_DEVICE_TOKEN, devices);
        for block in &self.tokens {
            let (skipped, left) = lanes;
            for (row, largest) in block.iter().zip(pooled.iter_mut().flatten()) {
                for lane in row.iter().skip(skipped).take(left) {
                    *largest = if *largest > *lane { *largest } else { *lane };
                }
            }
            lanes = (0, left.saturating_sub(LANES.saturating_sub(skipped)));
        }
        joined
    }
}

/// Applies the schema's normalisations to one token.
pub(super) fn normalise<const N: usize>(numbers: &[f32; N], table: &[Normalisation; N]) -> [f32; N] {
    let mut normalised = [0.0; N];
    for ((normalised, number), row) in normalised.iter_mut().zip(numbers).zip(table) {
        *normalised = row.apply(*number);
    }
    normalised
}

/// One token through its projector.
fn project<W: Stored, const INPUTS: usize>(
    layer: &Linear<'_, W, INPUTS, WIDTH_PANELS>,
    numbers: &[f32; INPUTS],
) -> [f32; WIDTH] {
    let mut token = [[0.0]; WIDTH];
    multiply(layer, &numbers.map(|number| [number]), &mut token);
    token.map(|[number]| number)
}

/// Writes a token to its lane.
fn put<const N: usize>(block: &mut Block<N>, lane: usize, token: [f32; N]) {
    for (row, number) in block.iter_mut().zip(token) {
        if let Some(place) = row.get_mut(lane) {
            *place = number;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workspace_fits_a_small_microcontroller() {
        assert!(size_of::<Workspace>() <= 20 * 1024, "{} bytes", size_of::<Workspace>());
    }
}
