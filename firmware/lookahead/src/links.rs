//! Which devices see which cells, one bit each.

use gleaner_units::{Cell, Grid, MAX_CELLS, Metres, Sight};
use heapless::Vec;

const WORDS: usize = MAX_CELLS / 32;

/// Line of sight between up to `D` devices and all cells: one bit for each pair.
///
/// The bits start as the map says and may be corrected in flight.
#[derive(Clone, Debug)]
pub struct Links<const D: usize> {
    grid: Grid,
    altitude: Metres,
    devices: Vec<Cell, D>,
    in_sight: [[u32; WORDS]; D],
}

impl<const D: usize> Default for Links<D> {
    fn default() -> Links<D> {
        Links::new()
    }
}

impl<const D: usize> Links<D> {
    /// No devices.
    #[must_use]
    pub const fn new() -> Links<D> {
        Links { grid: Grid::ONE_CELL, altitude: Metres(0.0), devices: Vec::new(), in_sight: [[0; WORDS]; D] }
    }

    /// Decides line of sight for all pairs; devices beyond the capacity are left out.
    ///
    /// # Cost
    /// One ray for each pair of a device and a cell.
    pub fn survey(&mut self, sight: &dyn Sight, devices: impl IntoIterator<Item = Cell>) {
        self.grid = sight.grid();
        self.altitude = sight.altitude();
        self.devices.clear();
        for (device, bits) in devices.into_iter().zip(&mut self.in_sight) {
            let _ = self.devices.push(device);
            bits.fill(0);
            for (index, cell) in self.grid.cells().enumerate() {
                if sight.sees(device, cell)
                    && let Some(word) = bits.get_mut(index / 32)
                {
                    *word |= 1 << (index % 32);
                }
            }
        }
    }

    /// The grid of the map.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// Flight altitude above the ground.
    #[must_use]
    pub const fn altitude(&self) -> Metres {
        self.altitude
    }

    /// Where the devices are.
    #[must_use]
    pub fn devices(&self) -> &[Cell] {
        &self.devices
    }

    /// Whether the device sees the cell with this index.
    #[must_use]
    pub fn sees(&self, device: usize, index: usize) -> bool {
        let word = self.in_sight.get(device).and_then(|bits| bits.get(index / 32));
        word.is_some_and(|word| word >> (index % 32) & 1 == 1)
    }

    /// All devices with whether they see the cell with this index.
    #[expect(clippy::wrong_self_convention, reason = "the links from this cell, not a conversion")]
    pub(crate) fn from_cell(&self, index: usize) -> impl Iterator<Item = (Cell, bool)> {
        let (place, bit) = (index / 32, index % 32);
        self.devices
            .iter()
            .zip(&self.in_sight)
            .map(move |(&device, bits)| (device, bits.get(place).is_some_and(|word| word >> bit & 1 == 1)))
    }

    /// Overrides the map for one device and one cell; a cell outside the grid changes nothing.
    pub fn correct(&mut self, device: usize, cell: Cell, sees: bool) {
        if let Some(index) = self.grid.index(cell)
            && let Some(word) = self.in_sight.get_mut(device).and_then(|bits| bits.get_mut(index / 32))
        {
            *word = if sees { *word | 1 << (index % 32) } else { *word & !(1 << (index % 32)) };
        }
    }
}
