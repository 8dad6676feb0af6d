//! The yield map: what a stay would bring, here and around.
//!
//! The paper's local map shows buildings, and leaves it to the network to work out who is heard from where. But map,
//! channel and devices are known on board, so the builder works it out: for every cell within 15 of the aircraft, the
//! data that ten slots of hovering there would bring from each device alone, added up. Where two streets cross and
//! three devices are in sight, the map is bright.
//!
//! The network sees [`LOCAL_MAP_SIDE`] by [`LOCAL_MAP_SIDE`] numbers, fine near the aircraft and coarse far away: per
//! axis the bands -15..-8, -7..-4, -3..-2, -1, 0, 1, 2..3, 4..7, 8..15, and of each patch its best cell.
//!
//! The terminal, when it is one of the eight cells around, stands in the map as [`TERMINAL_UNITS`]: a move there ends
//! the mission. In its offset alone, which is scaled for the whole city, one cell is too little to be seen: policies
//! flew over their base in the middle of a mission, and it was over.

use crate::schema::{TERMINAL_UNITS, YIELD_STEP_UNITS};
use crate::{DeviceState, LOCAL_MAP_CELLS, LOCAL_MAP_SIDE};
use gleaner_units::{Cell, Sight};
use heapless::Vec;

/// How far the map reaches, cells.
const REACH: i16 = 15;
const WINDOW: usize = 2 * REACH as usize + 1;
/// First and last offset of each band, cells.
const BANDS: [(i16, i16); LOCAL_MAP_SIDE] =
    [(-15, -8), (-7, -4), (-3, -2), (-1, -1), (0, 0), (1, 1), (2, 3), (4, 7), (8, 15)];
/// The stay that a yield is of, slots.
const SLOTS: f32 = 10.0;
const STEPS_MAX: u16 = 255;

/// Data units that a slot carries with line of sight, by the square of the distance in space, one entry every
/// [`TABLE_STEP_M2`]: `100 log2(1 + SNR)`, SNR = 66 dB - 25 log10(d), nothing below 5 dB (paper, eq. 6 and table of
/// simulation parameters; its noise, which the paper leaves open, as in the simulated world). The first entry is that
/// of the lowest flight altitude, 20 m.
const UNITS_PER_SLOT: [u16; 64] = [
    1112, 914, 789, 717, 665, 626, 593, 566, 542, 522, 503, 486, 471, 457, 445, 433, 422, 412, 402, 393, 384,
    376, 368, 361, 354, 347, 341, 334, 329, 323, 317, 312, 307, 302, 298, 293, 289, 284, 280, 276, 272, 269,
    265, 261, 258, 255, 251, 248, 245, 242, 239, 236, 233, 230, 228, 225, 223, 220, 218, 215, 213, 211, 208,
    206,
];
const TABLE_STEP_M2: f32 = 1200.0;
/// Where the table ends: nothing is heard from farther away.
const RANGE_M2: f32 = TABLE_STEP_M2 * (UNITS_PER_SLOT.len() - 1) as f32;

/// Data units per slot at this distance squared: the table, with straight lines between its entries.
pub(crate) fn units_per_slot(distance_m2: f32) -> f32 {
    let place = distance_m2 / TABLE_STEP_M2;
    let index = place as usize;
    let (Some(&near), Some(&far)) = (UNITS_PER_SLOT.get(index), UNITS_PER_SLOT.get(index + 1)) else {
        return 0.0;
    };
    let (near, far) = (f32::from(near), f32::from(far));
    near + (far - near) * (place - index as f32)
}

/// What is heard around the aircraft, while the devices are added one by one.
pub(crate) struct YieldMap<'a> {
    sight: &'a dyn Sight,
    center: Cell,
    /// Data units by north and east offset, the south-west corner first.
    units: [[u16; WINDOW]; WINDOW],
}

impl<'a> YieldMap<'a> {
    pub(crate) const fn new(sight: &'a dyn Sight, center: Cell) -> YieldMap<'a> {
        YieldMap { sight, center, units: [[0; WINDOW]; WINDOW] }
    }

    /// Adds what one device would send.
    ///
    /// # Cost
    /// At most one ray for each cell within reach of both the aircraft and the device.
    pub(crate) fn add(&mut self, device: &DeviceState) {
        if device.remaining.is_nan() || device.remaining <= 0.0 {
            return;
        }
        let grid = self.sight.grid();
        let cell_m2 = grid.cell().0 * grid.cell().0;
        let height_m2 = self.sight.altitude().0 * self.sight.altitude().0;
        let square_m2 = |offset: i16, aircraft: i16, device: i16| {
            let cells = f32::from(offset) + (f32::from(aircraft) - f32::from(device));
            cells * cells * cell_m2
        };
        let Cell { x, y } = self.center;
        for (line, north) in self.units.iter_mut().zip(-REACH..) {
            let row_m2 = square_m2(north, y, device.cell.y) + height_m2;
            if row_m2 >= RANGE_M2 {
                continue;
            }
            for (units, east) in line.iter_mut().zip(-REACH..) {
                let distance_m2 = row_m2 + square_m2(east, x, device.cell.x);
                if distance_m2 >= RANGE_M2 {
                    continue;
                }
                let cell = Cell::new(x.saturating_add(east), y.saturating_add(north));
                if grid.contains(cell) && self.sight.sees(device.cell, cell) {
                    let stay = SLOTS * units_per_slot(distance_m2);
                    // Never more than ten times a table entry.
                    *units = units.saturating_add(stay.min(device.remaining) as u16);
                }
            }
        }
    }

    /// The numbers that enter the model: data units, south-west first, row by row.
    pub(crate) fn patches(&self, terminal: Cell) -> Vec<f32, LOCAL_MAP_CELLS> {
        let mut patches = Vec::new();
        let (x, y) = (terminal.x.saturating_sub(self.center.x), terminal.y.saturating_sub(self.center.y));
        let is_beside = (x, y) != (0, 0);
        let band = |(first, last): (i16, i16)| (REACH + first) as usize..=(REACH + last) as usize;
        for north in BANDS {
            for east in BANDS {
                if is_beside && east == (x, x) && north == (y, y) {
                    let _ = patches.push(TERMINAL_UNITS);
                    continue;
                }
                let lines = self.units.get(band(north)).into_iter().flatten();
                let best = lines.flat_map(|line| line.get(band(east)).into_iter().flatten()).max();
                let steps = (best.copied().unwrap_or(0) / YIELD_STEP_UNITS).min(STEPS_MAX);
                let _ = patches.push(f32::from(steps * YIELD_STEP_UNITS));
            }
        }
        patches
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::{Grid, HeightMap, Metres, Rays};

    fn device(x: i16, y: i16, remaining: f32) -> DeviceState {
        DeviceState { cell: Cell::new(x, y), remaining, snr: None }
    }

    fn map(heights: &HeightMap, devices: &[DeviceState]) -> std::vec::Vec<f32> {
        let rays = Rays { heights, altitude_m: 60 };
        let mut map = YieldMap::new(&rays, Cell::new(20, 15));
        devices.iter().for_each(|device| map.add(device));
        map.patches(Cell::new(0, 0)).to_vec()
    }

    fn at(map: &[f32], column: usize, row: usize) -> f32 {
        map[row * LOCAL_MAP_SIDE + column]
    }

    #[test]
    fn the_table_is_the_formula() {
        for (index, &entry) in UNITS_PER_SLOT.iter().enumerate().take(63).skip(1) {
            let distance_m2 = index as f32 * TABLE_STEP_M2;
            let snr_db = 66.0 - 12.5 * libm::log10f(distance_m2);
            assert!(snr_db >= 5.0, "entry {index}");
            let units = 100.0 * libm::log2f(1.0 + libm::exp10f(0.1 * snr_db));
            assert!((units - f32::from(entry)).abs() <= 0.6, "entry {index}: {units}");
            assert_eq!(units_per_slot(distance_m2), f32::from(entry));
        }
        // The last entry ends the table.
        assert!(units_per_slot(62.99 * TABLE_STEP_M2) > 205.0);
        assert_eq!(units_per_slot(63.0 * TABLE_STEP_M2), 0.0);
        assert_eq!(units_per_slot(600.0), 1013.0);
    }

    #[test]
    fn bands_cover_the_window_once_and_mirror_each_other() {
        let mut next = -REACH;
        for (first, last) in BANDS {
            assert_eq!(first, next);
            next = last + 1;
        }
        assert_eq!(next, REACH + 1);
        for (band, mirror) in BANDS.iter().zip(BANDS.iter().rev()) {
            assert_eq!((band.0, band.1), (-mirror.1, -mirror.0));
        }
    }

    #[test]
    fn a_stay_brings_ten_slots_or_what_is_left() {
        let flat = HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap());
        let full = map(&flat, &[device(20, 15, 8000.0)]);
        // Right above: 717 units a slot, in steps of 64.
        assert_eq!(at(&full, 4, 4), 7168.0);
        assert!(at(&full, 5, 4) < 7168.0 && at(&full, 5, 4) == at(&full, 3, 4));
        // The nearest cell of the farthest band is 8 moves away.
        assert!(at(&full, 8, 4) > 0.0 && at(&full, 8, 4) < at(&full, 7, 4));
        let nearly_empty = map(&flat, &[device(20, 15, 130.0)]);
        assert_eq!(at(&nearly_empty, 4, 4), 128.0);
        let two = map(&flat, &[device(20, 15, 8000.0), device(20, 15, 130.0)]);
        assert_eq!(at(&two, 4, 4), 7296.0);
        let many = [device(20, 15, 8000.0); 12];
        assert_eq!(at(&map(&flat, &many), 4, 4), 16320.0, "the largest value");
        for bad in [f32::NAN, -1.0, 0.0] {
            assert_eq!(map(&flat, &[device(20, 15, bad)]), [0.0; LOCAL_MAP_CELLS]);
        }
    }

    #[test]
    fn buildings_and_the_edge_of_the_map_are_dark() {
        let mut heights = HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap());
        for y in 0..30 {
            heights.set(Cell::new(21, y), 50);
        }
        let map = map(&heights, &[device(20, 15, 8000.0)]);
        assert!(at(&map, 3, 4) > 0.0, "west of the wall");
        assert_eq!(at(&map, 6, 4), 0.0, "behind the wall");
        let rays = Rays { heights: &heights, altitude_m: 60 };
        let mut corner = YieldMap::new(&rays, Cell::new(0, 0));
        corner.add(&device(0, 0, 8000.0));
        let patches = corner.patches(Cell::new(30, 18));
        assert!(patches[..4 * LOCAL_MAP_SIDE].iter().all(|&units| units == 0.0));
    }

    #[test]
    fn the_terminal_is_marked_where_one_move_or_two_would_end_the_mission() {
        let flat = HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap());
        let rays = Rays { heights: &flat, altitude_m: 60 };
        let map = YieldMap::new(&rays, Cell::new(20, 15));
        for (terminal, mark) in [
            ((20, 16), Some((4, 5))),
            ((19, 15), Some((3, 4))),
            ((21, 14), Some((5, 3))),
            // Above it: it is entered by a move, not by a stay.
            ((20, 15), None),
            ((22, 15), None),
            ((20, 13), None),
            ((i16::MAX, i16::MIN), None),
        ] {
            let patches = map.patches(Cell::new(terminal.0, terminal.1));
            let mut expected = [0.0; LOCAL_MAP_CELLS];
            if let Some((column, row)) = mark {
                expected[row * LOCAL_MAP_SIDE + column] = TERMINAL_UNITS;
            }
            assert_eq!(patches, expected, "{terminal:?}");
        }
    }
}
