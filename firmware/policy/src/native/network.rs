//! The network's weights, in the order of a blob.

use super::reader::{BlobError, Reader};
use super::shape::{
    FEED_FORWARD, HEAD_HIDDEN, HEAD_INPUTS, LAYERS, LOGIT_PANELS, PANEL, WIDTH, WIDTH_PANELS,
};
use crate::LOCAL_MAP_CELLS;
use crate::schema::{DEVICE_FEATURES, PREFERENCE_FEATURES, UAV_FEATURES};
use zerocopy::{FromBytes, Immutable, KnownLayout};

/// Stored weights of [`PANEL`] outputs for one input.
pub(super) trait Stored: Copy + FromBytes + Immutable + KnownLayout + 'static {
    /// Whether each output has a scale.
    const SCALED: bool;

    /// The weights as floats, before the scale.
    fn widen(self) -> [f32; PANEL];
}

impl Stored for [f32; PANEL] {
    const SCALED: bool = false;

    #[inline(always)]
    fn widen(self) -> [f32; PANEL] {
        self
    }
}

impl Stored for [i16; PANEL] {
    const SCALED: bool = true;

    #[inline(always)]
    fn widen(self) -> [f32; PANEL] {
        self.map(f32::from)
    }
}

/// A linear layer: a scale and a bias for each output, and the weights in panels.
#[derive(Clone, Copy)]
pub(super) struct Linear<'m, W, const INPUTS: usize, const PANELS: usize> {
    pub scale: &'m [[f32; PANEL]; PANELS],
    pub bias: &'m [[f32; PANEL]; PANELS],
    pub weight: &'m [[W; INPUTS]; PANELS],
}

impl<'m, W: Stored, const INPUTS: usize, const PANELS: usize> Linear<'m, W, INPUTS, PANELS> {
    fn read(reader: &mut Reader<'m>) -> Result<Self, BlobError> {
        let scale = if W::SCALED { reader.take()? } else { &[[1.0; PANEL]; PANELS] };
        Ok(Linear { scale, bias: reader.take()?, weight: reader.take()? })
    }
}

/// Gain and bias of a layer norm.
#[derive(Clone, Copy)]
pub(super) struct Norm<'m> {
    pub gain: &'m [f32; WIDTH],
    pub bias: &'m [f32; WIDTH],
}

impl<'m> Norm<'m> {
    fn read(reader: &mut Reader<'m>) -> Result<Self, BlobError> {
        Ok(Norm { gain: reader.take()?, bias: reader.take()? })
    }
}

/// One encoder layer.
#[derive(Clone, Copy)]
pub(super) struct Encoder<'m, W> {
    /// Divided by the root of the head's width.
    pub query: Linear<'m, W, WIDTH, WIDTH_PANELS>,
    pub key_value: Linear<'m, W, WIDTH, { 2 * WIDTH_PANELS }>,
    pub out: Linear<'m, W, WIDTH, WIDTH_PANELS>,
    pub norm1: Norm<'m>,
    pub ff1: Linear<'m, W, WIDTH, { FEED_FORWARD / PANEL }>,
    pub ff2: Linear<'m, W, FEED_FORWARD, WIDTH_PANELS>,
    pub norm2: Norm<'m>,
}

impl<'m, W: Stored> Encoder<'m, W> {
    fn read(reader: &mut Reader<'m>) -> Result<Self, BlobError> {
        Ok(Encoder {
            query: Linear::read(reader)?,
            key_value: Linear::read(reader)?,
            out: Linear::read(reader)?,
            norm1: Norm::read(reader)?,
            ff1: Linear::read(reader)?,
            ff2: Linear::read(reader)?,
            norm2: Norm::read(reader)?,
        })
    }
}

/// The whole network, in blob order.
#[derive(Clone, Copy)]
pub(super) struct Network<'m, W> {
    pub project_uav: Linear<'m, W, UAV_FEATURES, WIDTH_PANELS>,
    pub project_preference: Linear<'m, W, PREFERENCE_FEATURES, WIDTH_PANELS>,
    pub project_map: Linear<'m, W, LOCAL_MAP_CELLS, WIDTH_PANELS>,
    pub project_device: Linear<'m, W, DEVICE_FEATURES, WIDTH_PANELS>,
    pub encoder: [Encoder<'m, W>; LAYERS],
    pub head: Linear<'m, W, HEAD_INPUTS, { HEAD_HIDDEN / PANEL }>,
    pub logits: Linear<'m, W, HEAD_HIDDEN, LOGIT_PANELS>,
}

impl<'m, W: Stored> Network<'m, W> {
    pub fn read(reader: &mut Reader<'m>) -> Result<Self, BlobError> {
        Ok(Network {
            project_uav: Linear::read(reader)?,
            project_preference: Linear::read(reader)?,
            project_map: Linear::read(reader)?,
            project_device: Linear::read(reader)?,
            encoder: [Encoder::read(reader)?, Encoder::read(reader)?],
            head: Linear::read(reader)?,
            logits: Linear::read(reader)?,
        })
    }
}
