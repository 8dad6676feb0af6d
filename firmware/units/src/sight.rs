//! Line of sight between ground and flight altitude, in integer arithmetic.

use crate::{Cell, Grid, HeightMap, Metres};

/// Line of sight in one city at one altitude.
pub trait Sight {
    /// The city's grid.
    fn grid(&self) -> Grid;

    /// Flight altitude above the ground.
    fn altitude(&self) -> Metres;

    /// Whether there is line of sight between a device at the centre of `ground` and an aircraft above the centre of `air`.
    fn sees(&self, ground: Cell, air: Cell) -> bool;
}

/// Line of sight computed for each query, where memory for a table is missing.
#[derive(Clone, Copy, Debug)]
pub struct Rays<'a> {
    /// The buildings.
    pub heights: &'a HeightMap,
    /// Flight altitude above the ground, m.
    pub altitude_m: u16,
}

impl Sight for Rays<'_> {
    fn grid(&self) -> Grid {
        self.heights.grid()
    }

    fn altitude(&self) -> Metres {
        Metres(f32::from(self.altitude_m))
    }

    fn sees(&self, ground: Cell, air: Cell) -> bool {
        ray_is_clear(self.heights, self.altitude_m, ground, air)
    }
}

/// Whether the straight line from the centre of `device` on the ground to the centre of `uav` at `altitude_m`
/// passes over the buildings (paper, section II-B: the link condition z).
///
/// Visits the cells that the line crosses, in order (Amanatides and Woo 1987). The line rises from the device, so it is
/// lowest over a cell where it enters it: at the fraction t of its length its height is `t * altitude_m`, and a taller
/// building blocks it. A line through the corner of four cells is also blocked by the two cells beside it. Touching a roof
/// does not block. Fractions are compared as products of integers, so the result is exact, identical on every machine, and
/// symmetric under mirroring of the city.
fn ray_is_clear(heights: &HeightMap, altitude_m: u16, device: Cell, uav: Cell) -> bool {
    let (width, height) = (i32::from(uav.x.abs_diff(device.x)), i32::from(uav.y.abs_diff(device.y)));
    let (step_x, step_y) = ((uav.x - device.x).signum(), (uav.y - device.y).signum());
    let mut cell = device;
    let (mut crossed_x, mut crossed_y) = (0, 0);
    while crossed_x < width || crossed_y < height {
        // The next border along x is at t = next_x / (2 width), along y at t = next_y / (2 height).
        let (next_x, next_y) = (2 * crossed_x + 1, 2 * crossed_y + 1);
        let order = (next_x * height).cmp(&(next_y * width));
        let (numerator, denominator) = if order.is_gt() { (next_y, 2 * height) } else { (next_x, 2 * width) };
        let blocks = |cell: Cell| {
            let building_m = i32::from(heights.height_m(cell).unwrap_or(0));
            i32::from(altitude_m) * numerator < building_m * denominator
        };
        let (over_x, over_y) = (cell.x + step_x, cell.y + step_y);
        if order.is_eq() && (blocks(Cell::new(over_x, cell.y)) || blocks(Cell::new(cell.x, over_y))) {
            return false;
        }
        if order.is_le() {
            cell.x = over_x;
            crossed_x += 1;
        }
        if order.is_ge() {
            cell.y = over_y;
            crossed_y += 1;
        }
        if blocks(cell) {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    fn city(rows: &str) -> HeightMap {
        HeightMap::from_csv(rows, Metres(20.0)).unwrap()
    }

    #[test]
    fn walls_block_if_taller_than_the_line_at_entry() {
        // From x = 0 to x = 2 the line enters cell 1 at a quarter of its length: 15 m high.
        let wall = |height_m: u8| city(&format!("0,{height_m},0\n"));
        let clear = |map: &HeightMap| ray_is_clear(map, 60, Cell::new(0, 0), Cell::new(2, 0));
        assert!(clear(&wall(15)), "touching does not block");
        assert!(!clear(&wall(16)));
        // Towards x = 1 itself the line enters it at half of its length: 30 m high.
        let near = |map: &HeightMap| ray_is_clear(map, 60, Cell::new(0, 0), Cell::new(1, 0));
        assert!(near(&wall(30)) && !near(&wall(31)));
    }

    #[test]
    fn diagonals_are_blocked_by_cells_at_their_corners() {
        // The corner lies at half of the line: 30 m high. The first row of the text is the northern one.
        let diagonal = |text: &str| ray_is_clear(&city(text), 60, Cell::new(0, 0), Cell::new(1, 1));
        assert!(diagonal("30,30\n0,30\n"), "touching a roof does not block");
        assert!(!diagonal("31,0\n0,0\n"), "the north-western corner");
        assert!(!diagonal("0,0\n0,31\n"), "the south-eastern corner");
        assert!(!diagonal("0,31\n0,0\n"), "the cell beyond");
    }

    #[test]
    fn straight_up_is_always_clear() {
        let heights = city("50,50,50\n50,0,50\n50,50,50\n");
        let rays = Rays { heights: &heights, altitude_m: 60 };
        let seen = rays.grid().cells().filter(|&air| rays.sees(Cell::new(1, 1), air));
        // The corner cells are entered at half of the line (30 m), like the sides: all blocked.
        assert!(seen.eq([Cell::new(1, 1)]));
    }
}
