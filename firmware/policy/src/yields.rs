//! The yield map: data units that a stay of ten slots would collect, at the aircraft's cell and around it.
//!
//! The paper's local map shows buildings and leaves radio coverage to the network. Map, channel model and devices are
//! known on board, so the builder computes coverage instead: for each cell within 15 cells of the aircraft, the sum over
//! the devices of what ten slots of hovering there would collect from that device alone.
//!
//! The network receives [`LOCAL_MAP_SIDE`] x [`LOCAL_MAP_SIDE`] patches, fine near the aircraft and coarse far away. The
//! bands of each axis are -15..-8, -7..-4, -3..-2, -1, 0, 1, 2..3, 4..7, 8..15; a patch holds the largest value of its
//! cells.
//!
//! If the terminal is one of the eight neighbouring cells, its patch holds [`TERMINAL_UNITS`], because a move there ends
//! the mission. The terminal's offset alone does not show this: it is scaled for the whole city, so one cell is a small
//! number, and policies without the mark entered the terminal by mistake.

use crate::schema::{REACHABLE_SNR_DB, TERMINAL_UNITS, YIELD_STEP_UNITS};
use crate::{ChannelOffset, DeviceState, LOCAL_MAP_CELLS, LOCAL_MAP_SIDE};
use gleaner_units::{Cell, Sight};
use heapless::Vec;

/// Radius of the map, cells.
pub(crate) const REACH: i16 = 15;
/// Cells along one side of the window.
pub(crate) const WINDOW: usize = 2 * REACH as usize + 1;
/// First and last offset of each band, cells.
const BANDS: [(i16, i16); LOCAL_MAP_SIDE] =
    [(-15, -8), (-7, -4), (-3, -2), (-1, -1), (0, 0), (1, 1), (2, 3), (4, 7), (8, 15)];
/// Length of the stay, slots.
const SLOTS: f32 = 10.0;
const STEPS_MAX: u16 = 255;

const ENTRIES: usize = 64;
/// The nominal channel: SNR at 1 m (dB), path-loss exponent, and data units for each bit per second per
/// hertz (paper, eq. 6 and the table of simulation parameters; the paper leaves the noise level open, this is the simulated
/// world's).
const SNR_AT_1M_DB: f32 = 66.0;
const EXPONENT: f32 = 2.5;
const SLOT_UNITS: f32 = 100.0;
/// The first entry is computed at the lowest flight altitude, 20 m.
const LOWEST_M2: f32 = 400.0;

/// Data units per slot with line of sight, by the square of the 3-D distance in steps of [`TABLE_STEP_M2`]:
/// `100 log2(1 + SNR)`, and 0 below [`REACHABLE_SNR_DB`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rates([u16; ENTRIES]);

/// The rates of the nominal channel.
pub(crate) const NOMINAL: Rates = Rates([
    1112, 914, 789, 717, 665, 626, 593, 566, 542, 522, 503, 486, 471, 457, 445, 433, 422, 412, 402, 393, 384,
    376, 368, 361, 354, 347, 341, 334, 329, 323, 317, 312, 307, 302, 298, 293, 289, 284, 280, 276, 272, 269,
    265, 261, 258, 255, 251, 248, 245, 242, 239, 236, 233, 230, 228, 225, 223, 220, 218, 215, 213, 211, 208,
    206,
]);
const TABLE_STEP_M2: f32 = 1200.0;
/// End of the table: devices farther away are out of range, also on a stronger channel.
const RANGE_M2: f32 = TABLE_STEP_M2 * (ENTRIES - 1) as f32;

impl Rates {
    /// The rates of a channel.
    ///
    /// # Cost
    /// 64 exponentials and 128 logarithms, none for the nominal channel.
    pub fn of(channel: ChannelOffset) -> Rates {
        if channel == ChannelOffset::NONE {
            return NOMINAL;
        }
        // The gain is that at 100 m.
        let snr_at_1m_db = SNR_AT_1M_DB + channel.gain_db + 20.0 * channel.exponent;
        let mut rates = NOMINAL;
        for (index, units) in (0_u8..).zip(&mut rates.0) {
            let distance_m2 = (f32::from(index) * TABLE_STEP_M2).max(LOWEST_M2);
            let snr_db = snr_at_1m_db - 5.0 * (EXPONENT + channel.exponent) * libm::log10f(distance_m2);
            *units = if snr_db >= REACHABLE_SNR_DB {
                let snr = exp2(snr_db * (0.1 * core::f32::consts::LOG2_10));
                // The cast of half more rounds to the nearest.
                (SLOT_UNITS * libm::log2f(1.0 + snr) + 0.5) as u16
            } else {
                0
            };
        }
        rates
    }

    /// Data units per slot at this squared distance, linearly interpolated.
    #[inline(always)]
    pub fn units_per_slot(&self, distance_m2: f32) -> f32 {
        let place = distance_m2 / TABLE_STEP_M2;
        let index = place as usize;
        let (Some(&near), Some(&far)) = (self.0.get(index), self.0.get(index + 1)) else {
            return 0.0;
        };
        let (near, far) = (f32::from(near), f32::from(far));
        near + (far - near) * (place - index as f32)
    }
}

/// `2^x` for x in 0..31, with a relative error below 0.0003: far below a data unit. The functions of `libm` calculate in double
/// precision, which the board has not, or are inlined where each instruction counts.
fn exp2(x: f32) -> f32 {
    let whole = x as u32;
    let rest = x - whole as f32;
    let power = 1.0 + rest * (0.695_976 + rest * (0.224_494 + rest * 0.079_020_4));
    power * 1_u32.checked_shl(whole).unwrap_or(u32::MAX) as f32
}

/// What ten slots at `cell` collect from a device with unlimited data; `None` out of range or out of sight.
#[cfg(feature = "std")]
pub(crate) fn stay_units(rates: &Rates, sight: &dyn Sight, device: Cell, cell: Cell) -> Option<f32> {
    let grid = sight.grid();
    let cell_m2 = grid.cell().0 * grid.cell().0;
    let height_m2 = sight.altitude().0 * sight.altitude().0;
    let square_m2 = |cell: i16, device: i16| {
        let cells = f32::from(cell) - f32::from(device);
        cells * cells * cell_m2
    };
    let distance_m2 = square_m2(cell.y, device.y) + height_m2 + square_m2(cell.x, device.x);
    (distance_m2 < RANGE_M2 && grid.contains(cell) && sight.sees(device, cell))
        .then(|| SLOTS * rates.units_per_slot(distance_m2))
}

/// Adds what one device would send to each cell of the window around `center`: data units by north and east offset,
/// the south-west corner first.
///
/// # Cost
/// At most one line-of-sight test for each cell within range of both the aircraft and the device.
pub(crate) fn add<const COLUMNS: usize>(
    window: &mut [[u16; COLUMNS]; WINDOW],
    rates: &Rates,
    sight: &dyn Sight,
    center: Cell,
    device: &DeviceState,
) {
    if device.remaining.is_nan() || device.remaining <= 0.0 {
        return;
    }
    let grid = sight.grid();
    let cell_m2 = grid.cell().0 * grid.cell().0;
    let height_m2 = sight.altitude().0 * sight.altitude().0;
    let square_m2 = |offset: i16, aircraft: i16, device: i16| {
        let cells = f32::from(offset) + (f32::from(aircraft) - f32::from(device));
        cells * cells * cell_m2
    };
    let Cell { x, y } = center;
    for (line, north) in window.iter_mut().zip(-REACH..) {
        let row_m2 = square_m2(north, y, device.cell.y) + height_m2;
        if row_m2 >= RANGE_M2 {
            continue;
        }
        for (units, east) in line.iter_mut().zip(-REACH..=REACH) {
            let distance_m2 = row_m2 + square_m2(east, x, device.cell.x);
            if distance_m2 >= RANGE_M2 {
                continue;
            }
            let cell = Cell::new(x.saturating_add(east), y.saturating_add(north));
            if grid.contains(cell) && sight.sees(device.cell, cell) {
                let stay = SLOTS * rates.units_per_slot(distance_m2);
                // At most ten times a table entry.
                *units = units.saturating_add(stay.min(device.remaining) as u16);
            }
        }
    }
}

/// The local map of a window around `center`: data units, row by row from the south-west.
pub(crate) fn patches<const COLUMNS: usize>(
    window: &[[u16; COLUMNS]; WINDOW],
    center: Cell,
    terminal: Cell,
) -> Vec<f32, LOCAL_MAP_CELLS> {
    let mut patches = Vec::new();
    let (x, y) = (terminal.x.saturating_sub(center.x), terminal.y.saturating_sub(center.y));
    let is_beside = (x, y) != (0, 0);
    let band = |(first, last): (i16, i16)| (REACH + first) as usize..=(REACH + last) as usize;
    for north in BANDS {
        // Column by column first: one pass over the rows of the band.
        let mut largest = [0; COLUMNS];
        for line in window.get(band(north)).into_iter().flatten() {
            for (largest, units) in largest.iter_mut().zip(line) {
                *largest = (*largest).max(*units);
            }
        }
        for east in BANDS {
            if is_beside && east == (x, x) && north == (y, y) {
                let _ = patches.push(TERMINAL_UNITS);
                continue;
            }
            let best = largest.get(band(east)).into_iter().flatten().max();
            let steps = (best.copied().unwrap_or(0) / YIELD_STEP_UNITS).min(STEPS_MAX);
            let _ = patches.push(f32::from(steps * YIELD_STEP_UNITS));
        }
    }
    patches
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
        let (mut window, center) = ([[0; WINDOW]; WINDOW], Cell::new(20, 15));
        devices.iter().for_each(|device| add(&mut window, &NOMINAL, &rays, center, device));
        patches(&window, center, Cell::new(0, 0)).to_vec()
    }

    fn at(map: &[f32], column: usize, row: usize) -> f32 {
        map[row * LOCAL_MAP_SIDE + column]
    }

    #[test]
    fn table_matches_the_formula() {
        for (index, &entry) in NOMINAL.0.iter().enumerate().take(63).skip(1) {
            let distance_m2 = index as f32 * TABLE_STEP_M2;
            let snr_db = 66.0 - 12.5 * libm::log10f(distance_m2);
            assert!(snr_db >= 5.0, "entry {index}");
            let units = 100.0 * libm::log2f(1.0 + libm::exp10f(0.1 * snr_db));
            assert!((units - f32::from(entry)).abs() <= 0.6, "entry {index}: {units}");
            assert_eq!(NOMINAL.units_per_slot(distance_m2), f32::from(entry));
        }
        // The last entry ends the table.
        assert!(NOMINAL.units_per_slot(62.99 * TABLE_STEP_M2) > 205.0);
        assert_eq!(NOMINAL.units_per_slot(63.0 * TABLE_STEP_M2), 0.0);
        assert_eq!(NOMINAL.units_per_slot(600.0), 1013.0);
    }

    #[test]
    fn powers_of_two_are_close() {
        for step in 0..3100 {
            let x = 0.01 * step as f32;
            assert!((exp2(x) / x.exp2() - 1.0).abs() < 3e-4, "2^{x}: {}", exp2(x));
        }
    }

    #[test]
    fn another_channel_has_other_rates() {
        // Almost nominal: the formula reproduces the table.
        let same = Rates::of(ChannelOffset { gain_db: 1e-4, exponent: 0.0 });
        assert!(same.0.iter().zip(&NOMINAL.0).take(63).all(|(a, b)| a.abs_diff(*b) <= 1));
        // 6 dB weaker: at 130 m the SNR is 7.2 dB, at 166 m it is below 5 dB.
        let weak = Rates::of(ChannelOffset { gain_db: -6.0, exponent: 0.0 });
        assert!((weak.units_per_slot(14.0 * TABLE_STEP_M2) - 264.0).abs() < 1.0);
        assert_eq!(weak.units_per_slot(23.0 * TABLE_STEP_M2), 0.0);
        // A larger exponent changes nothing at 100 m: 400 units per slot farther away become fewer, nearer more.
        let steep = Rates::of(ChannelOffset { gain_db: 0.0, exponent: 0.3 });
        assert!(steep.0[4] > NOMINAL.0[4] && steep.0[20] < NOMINAL.0[20]);
        let broken = Rates::of(ChannelOffset { gain_db: f32::NAN, exponent: 0.0 });
        assert_eq!(broken.0, [0; ENTRIES]);
    }

    #[test]
    fn bands_partition_the_window_symmetrically() {
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
    fn yield_is_ten_slots_or_the_remaining_data() {
        let flat = HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap());
        let full = map(&flat, &[device(20, 15, 8000.0)]);
        // Above the device: 717 units a slot, in steps of 64.
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
    fn yield_is_zero_behind_buildings_and_outside() {
        let mut heights = HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap());
        for y in 0..30 {
            heights.set(Cell::new(21, y), 50);
        }
        let map = map(&heights, &[device(20, 15, 8000.0)]);
        assert!(at(&map, 3, 4) > 0.0, "west of the wall");
        assert_eq!(at(&map, 6, 4), 0.0, "behind the wall");
        let rays = Rays { heights: &heights, altitude_m: 60 };
        let (mut window, corner) = ([[0; WINDOW]; WINDOW], Cell::new(0, 0));
        add(&mut window, &NOMINAL, &rays, corner, &device(0, 0, 8000.0));
        let patches = patches(&window, corner, Cell::new(30, 18));
        assert!(patches[..4 * LOCAL_MAP_SIDE].iter().all(|&units| units == 0.0));
    }

    #[test]
    fn neighbouring_terminal_is_marked() {
        let empty = [[0; WINDOW]; WINDOW];
        for (terminal, mark) in [
            ((20, 16), Some((4, 5))),
            ((19, 15), Some((3, 4))),
            ((21, 14), Some((5, 3))),
            // On the terminal: only a move enters it.
            ((20, 15), None),
            ((22, 15), None),
            ((20, 13), None),
            ((i16::MAX, i16::MIN), None),
        ] {
            let patches = patches(&empty, Cell::new(20, 15), Cell::new(terminal.0, terminal.1));
            let mut expected = [0.0; LOCAL_MAP_CELLS];
            if let Some((column, row)) = mark {
                expected[row * LOCAL_MAP_SIDE + column] = TERMINAL_UNITS;
            }
            assert_eq!(patches, expected, "{terminal:?}");
        }
    }
}
