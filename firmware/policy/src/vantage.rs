//! The vantage of a device: the cell from which to collect its data.
//!
//! The position of a device does not determine where it is received: one tower beside it blocks half of the city. The
//! vantage is the nearest cell to the aircraft with line of sight to the device and a fast link. Its offset and its distance
//! in moves are direct inputs for planning.

use crate::yields::Rates;
use gleaner_units::{Cell, Sight};

/// Lowest data rate of a vantage, data units per slot.
const FAST_UNITS: f32 = 400.0;
/// Search radius, cells. Farther away the rate is lower even at an altitude of 20 m and with cells of 20 m.
pub(crate) const REACH: i16 = 7;

/// East and north offset, in cells, from the aircraft at `from` to the vantage of the device at `device`.
///
/// Of equally near cells the one closest to the device counts. Of several equal ones the mean is returned, so that a
/// mirrored city gives the mirrored vantage. A device without a vantage is its own.
///
/// # Cost
/// At most one line-of-sight test for each of the 149 cells around the device.
pub(crate) fn vantage(rates: &Rates, sight: &dyn Sight, device: Cell, from: Cell) -> [f32; 2] {
    nearest(device, from, |cell, cells2| is_fast(rates, sight, device, cell, cells2))
}

/// Whether `cell` has line of sight and a fast link to `device`, which is the root of `cells2` cells away.
#[inline(always)]
pub(crate) fn is_fast(rates: &Rates, sight: &dyn Sight, device: Cell, cell: Cell, cells2: i32) -> bool {
    let grid = sight.grid();
    let cell_m2 = grid.cell().0 * grid.cell().0;
    let height_m2 = sight.altitude().0 * sight.altitude().0;
    rates.units_per_slot(cells2 as f32 * cell_m2 + height_m2) >= FAST_UNITS
        && grid.contains(cell)
        && sight.sees(device, cell)
}

/// As [`vantage`], where `is_fast` says which cells within [`REACH`] have a fast link.
#[inline(always)]
pub(crate) fn nearest(device: Cell, from: Cell, is_fast: impl Fn(Cell, i32) -> bool) -> [f32; 2] {
    let mut best = (i32::MAX, i32::MAX);
    let (mut sum, mut count) = ([0_i32; 2], 0_i32);
    for north in -REACH..=REACH {
        for east in -REACH..=REACH {
            let cells2 = i32::from(north) * i32::from(north) + i32::from(east) * i32::from(east);
            let cell = Cell::new(device.x.saturating_add(east), device.y.saturating_add(north));
            let offset = [i32::from(cell.x) - i32::from(from.x), i32::from(cell.y) - i32::from(from.y)];
            let rank = (offset.iter().map(|cells| cells.abs()).sum(), cells2);
            if rank > best || !is_fast(cell, cells2) {
                continue;
            }
            if rank < best {
                (best, sum, count) = (rank, [0; 2], 0);
            }
            sum = [sum[0] + offset[0], sum[1] + offset[1]];
            count += 1;
        }
    }
    match count {
        0 => [f32::from(device.x) - f32::from(from.x), f32::from(device.y) - f32::from(from.y)],
        count => sum.map(|cells| cells as f32 / count as f32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yields::NOMINAL;
    use gleaner_units::{Grid, HeightMap, Metres, Rays};

    fn flat() -> HeightMap {
        HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap())
    }

    fn seen(heights: &HeightMap, device: (i16, i16), from: (i16, i16)) -> [f32; 2] {
        let rays = Rays { heights, altitude_m: 60 };
        vantage(&NOMINAL, &rays, Cell::new(device.0, device.1), Cell::new(from.0, from.1))
    }

    #[test]
    fn open_ground_vantage_is_limited_by_the_rate() {
        // 400 units a slot: 21,900 m2 in space, 6.5 cells on the ground.
        assert_eq!(seen(&flat(), (20, 15), (20, 15)), [0.0, 0.0]);
        assert_eq!(seen(&flat(), (20, 15), (24, 15)), [0.0, 0.0], "the aircraft is at a vantage");
        assert_eq!(seen(&flat(), (20, 15), (30, 15)), [-4.0, 0.0]);
        assert_eq!(seen(&flat(), (20, 15), (20, 0)), [0.0, 9.0]);
        // From the diagonal (4, 5) and (5, 4) are equally near and fast: the mean.
        assert_eq!(seen(&flat(), (20, 15), (30, 25)), [-5.5, -5.5]);
    }

    #[test]
    fn walls_and_map_edges_limit_the_vantage() {
        let mut heights = flat();
        for y in 0..30 {
            heights.set(Cell::new(21, y), 50);
        }
        assert_eq!(seen(&heights, (20, 15), (30, 15)), [-10.0, 0.0], "nothing east of the wall is in sight");
        assert_eq!(seen(&heights, (20, 15), (10, 15)), [4.0, 0.0]);
        assert_eq!(seen(&flat(), (0, 0), (0, 29)), [0.0, -23.0]);
    }

    #[test]
    fn device_without_a_vantage_is_its_own() {
        let heights = flat();
        let rays = |altitude_m| Rays { heights: &heights, altitude_m };
        assert_eq!(vantage(&NOMINAL, &rays(200), Cell::new(5, 5), Cell::new(9, 2)), [-4.0, 3.0]);
        let beyond = Cell::new(i16::MAX, i16::MIN);
        assert_eq!(vantage(&NOMINAL, &rays(60), beyond, Cell::new(0, 0)), [32767.0, -32768.0]);
    }
}
