//! Coverage of the devices as seen from one cell: the source of the local map and of the vantages.

use crate::vantage::vantage;
use crate::yields::{self, Rates, WINDOW};
use crate::{DeviceState, LOCAL_MAP_CELLS, Situation};
use gleaner_units::{Cell, Sight};
use heapless::Vec;

/// Coverage around the aircraft. Devices are added one by one.
pub(crate) trait Outlook {
    /// Adds the yield of one device.
    fn add(&mut self, device: &DeviceState);

    /// East and north offset, in cells, to the vantage of a device.
    fn vantage(&mut self, device: Cell) -> [f32; 2];

    /// The local map.
    fn patches(&self, terminal: Cell) -> Vec<f32, LOCAL_MAP_CELLS>;
}

/// Computes coverage from line-of-sight tests, without memory of earlier observations.
pub(crate) struct Direct<'a> {
    rates: Rates,
    sight: &'a dyn Sight,
    center: Cell,
    window: [[u16; WINDOW]; WINDOW],
}

impl<'a> Direct<'a> {
    pub(crate) fn of(situation: &Situation<'a>) -> Direct<'a> {
        let &Situation { sight, cell: center, channel, .. } = situation;
        Direct { rates: Rates::of(channel), sight, center, window: [[0; WINDOW]; WINDOW] }
    }
}

impl Outlook for Direct<'_> {
    fn add(&mut self, device: &DeviceState) {
        yields::add(&mut self.window, &self.rates, self.sight, self.center, device);
    }

    fn vantage(&mut self, device: Cell) -> [f32; 2] {
        vantage(&self.rates, self.sight, device, self.center)
    }

    fn patches(&self, terminal: Cell) -> Vec<f32, LOCAL_MAP_CELLS> {
        yields::patches(&self.window, self.center, terminal)
    }
}
