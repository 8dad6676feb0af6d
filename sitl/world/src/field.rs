//! The devices during a mission.

use crate::{Realization, ScenarioError, World};
use gleaner_units::{Cell, Db};
use rand::Rng;

/// A device during a mission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Device {
    /// Its cell.
    pub cell: Cell,
    /// D_0: its data at the start, data units.
    pub initial_units: f32,
    /// D_t: its data now, data units; exactly 0 when it is empty.
    pub remaining_units: f32,
    /// SNR_t: SNR of its link in the present slot.
    pub snr: Db,
    /// rho_t: whether the SNR reaches the threshold, whether or not data is left.
    pub reachable: bool,
    row: u32,
}

/// The transmission of one slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Serving {
    /// Index of the device that was served.
    pub device: usize,
    /// Data sent, data units.
    pub collected_units: f32,
}

/// The devices of one mission: remaining data and links. It is independent of the aircraft's motion, so an episode on the
/// grid and a simulated aircraft use the same field.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    devices: Vec<Device>,
    initial_units: f32,
    collected_units: f32,
}

impl Field {
    /// The devices of `realization`, without SNR: call [`Field::listen`] before the first slot.
    ///
    /// # Errors
    /// [`ScenarioError::DeviceNotOpen`] if the realization was drawn for another city.
    pub fn new(world: &World, realization: &Realization) -> Result<Field, ScenarioError> {
        let mut field = Field { devices: Vec::new(), initial_units: 0.0, collected_units: 0.0 };
        field.reset(world, realization)?;
        Ok(field)
    }

    /// As [`Field::new`], reusing the memory of this field. After an error the field is empty.
    ///
    /// # Errors
    /// Those of [`Field::new`].
    pub fn reset(&mut self, world: &World, realization: &Realization) -> Result<(), ScenarioError> {
        self.devices.clear();
        self.initial_units = 0.0;
        self.collected_units = 0.0;
        for placement in realization.devices() {
            let Some(row) = world.city().sight().row(placement.cell) else {
                self.devices.clear();
                return Err(ScenarioError::DeviceNotOpen(placement.cell));
            };
            self.initial_units += placement.data_units;
            self.devices.push(Device {
                cell: placement.cell,
                initial_units: placement.data_units,
                remaining_units: placement.data_units,
                snr: Db(f32::NEG_INFINITY),
                reachable: false,
                row,
            });
        }
        Ok(())
    }

    /// Draws every device's SNR for a slot with the aircraft over `uav`. Outside the city there is no reception.
    pub fn listen(&mut self, world: &World, uav: Cell, rng: &mut impl Rng) {
        let channel = world.channel();
        let Some(index) = world.city().grid().index(uav) else {
            for device in &mut self.devices {
                device.snr = Db(f32::NEG_INFINITY);
                device.reachable = false;
            }
            return;
        };
        for pair in self.devices.chunks_mut(2) {
            let link = |device: &Device| world.link(device.row, device.cell, uav, index);
            let first = link(&pair[0]);
            let second = pair.get(1).map_or(first, link);
            let draws = channel.draw_pair([first, second], rng);
            for (device, snr) in pair.iter_mut().zip(draws) {
                device.snr = snr;
                device.reachable = snr >= channel.threshold;
            }
        }
    }

    /// Serves one slot with the SNR drawn last. Of the reachable devices with data left, the one with the highest SNR (the
    /// first of equal ones) sends as much as the slot carries and at most its remaining data (paper, eq. 6 to 8).
    pub fn serve(&mut self, world: &World) -> Option<Serving> {
        let mut best: Option<(usize, Db)> = None;
        for (index, device) in self.devices.iter().enumerate() {
            let wanted = device.reachable && device.remaining_units > 0.0;
            if wanted && best.is_none_or(|(_, highest)| device.snr > highest) {
                best = Some((index, device.snr));
            }
        }
        let (index, snr) = best?;
        let device = &mut self.devices[index];
        let collected_units = world.channel().data_per_slot(snr).min(device.remaining_units);
        device.remaining_units -= collected_units;
        self.collected_units += collected_units;
        Some(Serving { device: index, collected_units })
    }

    /// The devices, in the realization's order.
    #[must_use]
    pub fn devices(&self) -> &[Device] {
        &self.devices
    }

    /// Initial data of all devices, data units.
    #[must_use]
    pub const fn initial_units(&self) -> f32 {
        self.initial_units
    }

    /// Data collected so far, data units.
    #[must_use]
    pub const fn collected_units(&self) -> f32 {
        self.collected_units
    }

    /// Data collected so far, as a fraction of the initial data; 1 if there was none.
    #[must_use]
    pub fn collected_fraction(&self) -> f32 {
        if self.initial_units > 0.0 { self.collected_units / self.initial_units } else { 1.0 }
    }
}
