//! Tokens from tables: what each device can send to each cell of a city is computed once.

use crate::outlook::Outlook;
use crate::vantage::{self, is_fast, nearest, vantage};
use crate::yields::{self, NOMINAL, REACH, WINDOW};
use crate::{ChannelOffset, DeviceState, LOCAL_MAP_CELLS, Situation, Slots, Tokens};
use gleaner_units::{Cell, Grid, Metres, Sight};
use heapless::Vec as Few;

/// Columns of a window in memory: one more than needed, for whole vector registers.
const COLUMNS: usize = WINDOW + 1;

/// Rows, and columns, of the cells in which a vantage is searched.
const FAST_ROWS: usize = 2 * vantage::REACH as usize + 1;

/// Builds the same tokens as [`Tokens::build`], bit for bit, for many observations of one city.
///
/// The coverage of a device depends only on its cell, so it is computed when the device first appears; an observation
/// then limits it to the remaining data and adds it up around the aircraft. Vantages are kept for each pair of device
/// and aircraft cell.
///
/// Use one table for one city: the buildings behind [`Situation::sight`] must not change. A different grid or altitude
/// clears the table. It is for the nominal channel; tokens of another one are built without it.
#[derive(Clone, Debug, Default)]
pub struct TokenTable {
    key: Option<(Grid, Metres)>,
    /// By grid index of the device.
    devices: Vec<Option<Box<Coverage>>>,
}

/// What one device can send.
#[derive(Clone, Debug)]
struct Coverage {
    /// Data units of a stay with unlimited data; the grid with a margin of [`REACH`] cells, row by row.
    stay_units: Vec<u16>,
    /// Numbers in one row of `stay_units`.
    stride: usize,
    /// Vantages by grid index of the aircraft.
    vantages: Vec<Option<[f32; 2]>>,
    /// Cells around the device with a fast link: one bit a cell, row by row from the south-west.
    fast: [u16; FAST_ROWS],
}

impl Coverage {
    /// # Cost
    /// One line-of-sight test for each cell in range.
    fn new(sight: &dyn Sight, device: Cell) -> Coverage {
        let grid = sight.grid();
        let stride = usize::from(grid.width()) + COLUMNS;
        let margin = REACH as usize;
        let mut stay_units = vec![0; stride * (usize::from(grid.height()) + WINDOW)];
        for cell in grid.cells() {
            let place = (cell.y as usize + margin) * stride + cell.x as usize + margin;
            if let (Some(units), Some(place)) =
                (yields::stay_units(&NOMINAL, sight, device, cell), stay_units.get_mut(place))
            {
                *place = units as u16;
            }
        }
        let mut fast = [0; FAST_ROWS];
        for (row, north) in fast.iter_mut().zip(-vantage::REACH..) {
            for (bit, east) in (0..FAST_ROWS).zip(-vantage::REACH..) {
                let cell = Cell::new(device.x.saturating_add(east), device.y.saturating_add(north));
                let cells2 = i32::from(east) * i32::from(east) + i32::from(north) * i32::from(north);
                *row |= u16::from(is_fast(&NOMINAL, sight, device, cell, cells2)) << bit;
            }
        }
        Coverage { stay_units, stride, vantages: vec![None; grid.len()], fast }
    }

    /// Whether `cell` has a fast link to `device`.
    fn is_fast(&self, device: Cell, cell: Cell) -> bool {
        let place = |cell: i16, device: i16| usize::try_from(cell - device + vantage::REACH).ok();
        let row = place(cell.y, device.y).and_then(|row| self.fast.get(row));
        row.zip(place(cell.x, device.x)).is_some_and(|(row, bit)| row >> bit & 1 == 1)
    }

    /// Adds the yield, limited to `remaining`, to the window around `center`, which is inside the grid.
    fn add(&self, window: &mut [[u16; COLUMNS]; WINDOW], center: Cell, remaining: u16) {
        let lines = self.stay_units.chunks_exact(self.stride).skip(center.y as usize);
        for (line, stays) in window.iter_mut().zip(lines) {
            let stays = stays.get(center.x as usize..).and_then(|stays| stays.first_chunk::<COLUMNS>());
            let Some(stays) = stays else { continue };
            for (units, stay) in line.iter_mut().zip(stays) {
                // The lower of `stay` and `remaining`, in operations that SSE2 has for 16 bits.
                *units = units.saturating_add(stay.wrapping_sub(stay.saturating_sub(remaining)));
            }
        }
    }
}

impl TokenTable {
    /// An empty table.
    #[must_use]
    pub fn new() -> TokenTable {
        TokenTable::default()
    }

    /// As [`Tokens::build`].
    ///
    /// # Cost
    /// Below a microsecond for each six devices once their coverage is known.
    pub fn build(
        &mut self,
        situation: &Situation<'_>,
        devices: impl IntoIterator<Item = DeviceState>,
    ) -> (Tokens, Slots) {
        let key = (situation.sight.grid(), situation.sight.altitude());
        let is_nominal = situation.channel == ChannelOffset::NONE;
        let Some(aircraft) = key.0.index(situation.cell).filter(|_| is_nominal) else {
            return Tokens::build(situation, devices);
        };
        if self.key != Some(key) {
            self.key = Some(key);
            self.devices = vec![None; key.0.len()];
        }
        let mut outlook = Tabled {
            table: self,
            grid: key.0,
            sight: situation.sight,
            center: situation.cell,
            aircraft,
            window: [[0; COLUMNS]; WINDOW],
        };
        Tokens::assemble(situation, devices, &mut outlook)
    }
}

struct Tabled<'a> {
    table: &'a mut TokenTable,
    grid: Grid,
    sight: &'a dyn Sight,
    center: Cell,
    /// Grid index of `center`.
    aircraft: usize,
    window: [[u16; COLUMNS]; WINDOW],
}

/// `None` for a device outside the grid.
fn coverage<'t>(
    table: &'t mut TokenTable,
    grid: Grid,
    sight: &dyn Sight,
    device: Cell,
) -> Option<&'t mut Coverage> {
    let place = table.devices.get_mut(grid.index(device)?)?;
    Some(place.get_or_insert_with(|| Box::new(Coverage::new(sight, device))))
}

impl Outlook for Tabled<'_> {
    fn add(&mut self, device: &DeviceState) {
        if device.remaining.is_nan() || device.remaining <= 0.0 {
            return;
        }
        match coverage(self.table, self.grid, self.sight, device.cell) {
            // The cast saturates at more than any stay collects.
            Some(coverage) => coverage.add(&mut self.window, self.center, device.remaining as u16),
            None => yields::add(&mut self.window, &NOMINAL, self.sight, self.center, device),
        }
    }

    fn vantage(&mut self, device: Cell) -> [f32; 2] {
        let (sight, center, aircraft) = (self.sight, self.center, self.aircraft);
        let Some(coverage) = coverage(self.table, self.grid, sight, device) else {
            return vantage(&NOMINAL, sight, device, center);
        };
        if let Some(&Some(known)) = coverage.vantages.get(aircraft) {
            return known;
        }
        let offset = nearest(device, center, |cell, _| coverage.is_fast(device, cell));
        if let Some(place) = coverage.vantages.get_mut(aircraft) {
            *place = Some(offset);
        }
        offset
    }

    fn patches(&self, terminal: Cell) -> Few<f32, LOCAL_MAP_CELLS> {
        yields::patches(&self.window, self.center, terminal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preference;
    use gleaner_units::{BatteryUnits, Db, HeightMap, Rays};
    use proptest::prelude::*;

    fn city(seed: u64) -> HeightMap {
        let grid = Grid::new(40, 30, Metres(20.0)).unwrap();
        let mut heights = HeightMap::flat(grid);
        let mut state = seed;
        for cell in grid.cells() {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            heights.set(cell, if state >> 62 == 0 { (state >> 33) as u8 % 51 } else { 0 });
        }
        heights
    }

    proptest! {
        #[test]
        fn table_and_direct_computation_agree(
            seed in 0_u64..1000,
            cells in prop::collection::vec((-2_i16..42, -2_i16..32), 1..8),
            devices in prop::collection::vec(
                (-1_i16..41, -1_i16..31, -10.0_f32..9000.0, prop::option::of(-40.0_f32..30.0)),
                0..14,
            ),
            gain_db in -9.0_f32..9.0,
        ) {
            let heights = city(seed);
            let sight = Rays { heights: &heights, altitude_m: 60 };
            let mut table = TokenTable::new();
            let channel = ChannelOffset { gain_db, exponent: 0.02 * gain_db };
            for (step, (x, y)) in cells.into_iter().enumerate() {
                let situation = Situation {
                    cell: Cell::new(x, y),
                    battery: BatteryUnits(80.0),
                    spare: BatteryUnits(48.0),
                    terminal: Cell::new(x + 1, y),
                    preference: Preference::new(0.25).unwrap(),
                    sight: &sight,
                    channel: if step % 3 == 2 { channel } else { ChannelOffset::NONE },
                };
                let devices = || devices.iter().map(|&(x, y, remaining, snr)| DeviceState {
                    cell: Cell::new(x, y),
                    remaining: remaining - 700.0 * step as f32,
                    snr: snr.map(Db),
                });
                prop_assert_eq!(table.build(&situation, devices()), Tokens::build(&situation, devices()));
            }
        }
    }
}
