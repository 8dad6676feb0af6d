//! Line of sight from the ground to flight altitude, decided in whole numbers.

use gleaner_units::{Cell, Grid, HeightMap};

/// Which open cell sees which cell at flight altitude: one bit for each pair.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SightTable {
    grid: Grid,
    /// By grid index: the cell's row, or [`NO_ROW`] for a built cell.
    rows: Vec<u32>,
    words_per_row: usize,
    bits: Vec<u64>,
}

const NO_ROW: u32 = u32::MAX;

impl SightTable {
    /// # Cost
    /// One ray for each pair of an open cell and a cell: 0.85 million in the default city.
    pub(crate) fn new(heights: &HeightMap, altitude_m: u16) -> SightTable {
        let grid = heights.grid();
        let words_per_row = grid.len().div_ceil(64);
        let mut rows = vec![NO_ROW; grid.len()];
        let mut bits = Vec::new();
        let open = grid.cells().enumerate().filter(|&(_, cell)| heights.height_m(cell) == Some(0));
        for (row, (index, device)) in (0..).zip(open) {
            rows[index] = row;
            let begin = bits.len();
            bits.resize(begin + words_per_row, 0);
            for (column, uav) in grid.cells().enumerate() {
                if ray_is_clear(heights, altitude_m, device, uav) {
                    bits[begin + column / 64] |= 1 << (column % 64);
                }
            }
        }
        SightTable { grid, rows, words_per_row, bits }
    }

    /// The row of an open cell; `None` for a built cell and outside the grid.
    pub(crate) fn row(&self, device: Cell) -> Option<u32> {
        self.grid.index(device).map(|index| self.rows[index]).filter(|&row| row != NO_ROW)
    }

    /// Whether the open cell with this row sees the cell with index `uav`.
    pub(crate) fn sees(&self, row: u32, uav: usize) -> bool {
        self.bits[row as usize * self.words_per_row + uav / 64] & (1 << (uav % 64)) != 0
    }
}

/// Whether the straight line from the centre of `device` on the ground to the centre of `uav` at `altitude_m`
/// passes over the buildings (paper, section II-B: the link condition z).
///
/// Walks the cells that the line crosses, in order (Amanatides and Woo). The line rises all the way, so it is
/// lowest over a cell where it enters it: at the fraction t of its length it is `t * altitude_m` high, and a
/// building taller than that blocks it. Buildings are closed: a line through the exact corner of four cells
/// touches the two beside its way, and they block it too. Touching a roof does not. All fractions are
/// compared as products of whole numbers, so the answer is exact, the same everywhere and in every mirror
/// image of the city.
fn ray_is_clear(heights: &HeightMap, altitude_m: u16, device: Cell, uav: Cell) -> bool {
    let (width, height) = (i64::from(uav.x.abs_diff(device.x)), i64::from(uav.y.abs_diff(device.y)));
    let (step_x, step_y) = ((uav.x - device.x).signum(), (uav.y - device.y).signum());
    let mut cell = device;
    let (mut crossed_x, mut crossed_y) = (0, 0);
    while crossed_x < width || crossed_y < height {
        // The next border eastwards or westwards lies at t = next_x / (2 width), northwards or southwards
        // at t = next_y / (2 height).
        let (next_x, next_y) = (2 * crossed_x + 1, 2 * crossed_y + 1);
        let order = (next_x * height).cmp(&(next_y * width));
        let (numerator, denominator) = if order.is_gt() { (next_y, 2 * height) } else { (next_x, 2 * width) };
        let blocks = |cell: Cell| {
            let building_m = i64::from(heights.height_m(cell).unwrap_or(0));
            i64::from(altitude_m) * numerator < building_m * denominator
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
    use gleaner_units::Metres;

    fn city(rows: &str) -> HeightMap {
        HeightMap::from_csv(rows, Metres(20.0)).unwrap()
    }

    #[test]
    fn a_wall_blocks_exactly_when_it_is_taller_than_the_line_where_it_enters() {
        // From x = 0 to x = 2 the line enters cell 1 at a quarter of its length: 15 m high.
        let wall = |height_m: u8| city(&format!("0,{height_m},0\n"));
        let clear = |map: &HeightMap| ray_is_clear(map, 60, Cell::new(0, 0), Cell::new(2, 0));
        assert!(clear(&wall(15)), "touching is clear");
        assert!(!clear(&wall(16)));
        // Towards x = 1 itself the line enters it at half of its length: 30 m high.
        let near = |map: &HeightMap| ray_is_clear(map, 60, Cell::new(0, 0), Cell::new(1, 0));
        assert!(near(&wall(30)) && !near(&wall(31)));
    }

    #[test]
    fn a_diagonal_is_blocked_by_each_corner_it_touches() {
        // The corner lies at half of the line: 30 m high. The first row of the text is the northern one.
        let diagonal = |text: &str| ray_is_clear(&city(text), 60, Cell::new(0, 0), Cell::new(1, 1));
        assert!(diagonal("30,30\n0,30\n"), "touching a roof is clear");
        assert!(!diagonal("31,0\n0,0\n"), "the north-western corner");
        assert!(!diagonal("0,0\n0,31\n"), "the south-eastern corner");
        assert!(!diagonal("0,31\n0,0\n"), "the cell beyond");
    }

    #[test]
    fn straight_up_is_always_clear() {
        let map = city("50,50,50\n50,0,50\n50,50,50\n");
        assert!(ray_is_clear(&map, 60, Cell::new(1, 1), Cell::new(1, 1)));
        let table = SightTable::new(&map, 60);
        assert_eq!(table.row(Cell::new(1, 1)), Some(0));
        assert_eq!(table.row(Cell::new(0, 1)), None);
        assert_eq!(table.row(Cell::new(3, 1)), None);
        let seen: Vec<usize> = (0..9).filter(|&uav| table.sees(0, uav)).collect();
        // The corner cells are entered at half of the line (30 m), like the sides: all blocked.
        assert_eq!(seen, [4]);
    }
}
