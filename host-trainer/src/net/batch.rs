//! Inputs: samples, and batches that hold only the devices that are present.

use super::shape::{DEVICE_FEATURES, DEVICES_MAX, MAP_CELLS, PREFERENCE_FEATURES, UAV_FEATURES};
use gleaner_policy::{LOCAL_MAP_SIDE, View};

/// Normalised features of one device.
pub type DeviceFeatures = [f32; DEVICE_FEATURES];

/// One normalised observation. Its size is fixed, so that a replay memory can store it without allocation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Spare battery, battery, terminal dx, terminal dy; normalised.
    pub uav: [f32; UAV_FEATURES],
    /// Weights of data and of energy.
    pub preference: [f32; PREFERENCE_FEATURES],
    /// Normalised yield map, south row first.
    pub local_map: [f32; MAP_CELLS],
    /// Normalised devices; the first `device_count` are present.
    pub devices: [DeviceFeatures; DEVICES_MAX],
    /// Number of devices present, at most [`DEVICES_MAX`].
    pub device_count: u8,
}

impl Sample {
    /// The devices that are present.
    #[must_use]
    pub fn devices_present(&self) -> &[DeviceFeatures] {
        &self.devices[..usize::from(self.device_count)]
    }

    /// The same, rotated and mirrored.
    #[must_use]
    pub fn seen(&self, view: View) -> Sample {
        let mut seen = *self;
        seen.uav[2..].copy_from_slice(&view.offset([self.uav[2], self.uav[3]]));
        for device in &mut seen.devices {
            // The device and its vantage.
            for [first, second] in [[0, 1], [5, 6]] {
                [device[first], device[second]] = view.offset([device[first], device[second]]);
            }
        }
        for row in 0..LOCAL_MAP_SIDE {
            for column in 0..LOCAL_MAP_SIDE {
                let [to, line] = view.place([column, row], LOCAL_MAP_SIDE);
                seen.local_map[line * LOCAL_MAP_SIDE + to] = self.local_map[row * LOCAL_MAP_SIDE + column];
            }
        }
        seen
    }
}

impl Default for Sample {
    fn default() -> Self {
        Self {
            uav: [0.0; UAV_FEATURES],
            preference: [0.0; PREFERENCE_FEATURES],
            local_map: [0.0; MAP_CELLS],
            devices: [[0.0; DEVICE_FEATURES]; DEVICES_MAX],
            device_count: 0,
        }
    }
}

/// Packed samples. Each kind of token has its own matrix.
///
/// [`Batch::clear`] keeps the memory.
#[derive(Clone, Debug)]
pub struct Batch {
    /// `[samples, UAV_FEATURES]`.
    pub(super) uav: Vec<f32>,
    /// `[samples, PREFERENCE_FEATURES]`.
    pub(super) preference: Vec<f32>,
    /// `[samples, map_cells]`.
    pub(super) local_map: Vec<f32>,
    /// `[devices of all samples, device_features]`.
    pub(super) devices: Vec<f32>,
    /// Index of each sample's first device, and at the end the number of all devices: `[samples + 1]`.
    pub(super) first_device: Vec<usize>,
}

impl Default for Batch {
    fn default() -> Self {
        Self {
            uav: Vec::new(),
            preference: Vec::new(),
            local_map: Vec::new(),
            devices: Vec::new(),
            first_device: vec![0],
        }
    }
}

impl Batch {
    /// A batch without samples.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Removes the samples and keeps the memory.
    pub fn clear(&mut self) {
        self.uav.clear();
        self.preference.clear();
        self.local_map.clear();
        self.devices.clear();
        self.first_device.truncate(1);
    }

    /// Appends one sample of normalised features with the sizes of [`super::Shape`]. `devices` are those present, in any
    /// order.
    ///
    /// # Panics
    /// With more than [`DEVICES_MAX`] devices.
    pub fn push<const MAP: usize, const DEVICE: usize>(
        &mut self,
        uav: &[f32; UAV_FEATURES],
        preference: &[f32; PREFERENCE_FEATURES],
        local_map: &[f32; MAP],
        devices: &[[f32; DEVICE]],
    ) {
        assert!(devices.len() <= DEVICES_MAX, "{} devices in one sample", devices.len());
        self.uav.extend_from_slice(uav);
        self.preference.extend_from_slice(preference);
        self.local_map.extend_from_slice(local_map);
        self.devices.extend_from_slice(devices.as_flattened());
        self.first_device.push(self.device_total() + devices.len());
    }

    /// Appends a sample.
    pub fn push_sample(&mut self, sample: &Sample) {
        self.push(&sample.uav, &sample.preference, &sample.local_map, sample.devices_present());
    }

    /// Samples in the batch.
    #[must_use]
    pub fn len(&self) -> usize {
        self.first_device.len() - 1
    }

    /// Whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Devices of all samples.
    pub(super) fn device_total(&self) -> usize {
        self.first_device.last().copied().unwrap_or(0)
    }

    /// Devices present in one sample.
    #[must_use]
    pub fn device_count(&self, sample: usize) -> usize {
        self.first_device[sample + 1] - self.first_device[sample]
    }
}
