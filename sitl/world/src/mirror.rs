//! Reflections of the grid: training in one city and its reflections is training in four cities.

use gleaner_units::{Action, Cell, Grid, HeightMap};

/// A reflection of the grid. Applied twice it changes nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mirror {
    /// East and west change places.
    pub east_west: bool,
    /// North and south change places.
    pub north_south: bool,
}

impl Mirror {
    /// All four, the identity first.
    pub const ALL: [Mirror; 4] = [
        Mirror { east_west: false, north_south: false },
        Mirror { east_west: true, north_south: false },
        Mirror { east_west: false, north_south: true },
        Mirror { east_west: true, north_south: true },
    ];

    /// The image of a cell of `grid`.
    #[must_use]
    pub const fn cell(self, grid: Grid, cell: Cell) -> Cell {
        Cell {
            x: if self.east_west { grid.width() as i16 - 1 - cell.x } else { cell.x },
            y: if self.north_south { grid.height() as i16 - 1 - cell.y } else { cell.y },
        }
    }

    /// The image of an action.
    #[must_use]
    pub const fn action(self, action: Action) -> Action {
        match action {
            Action::East if self.east_west => Action::West,
            Action::West if self.east_west => Action::East,
            Action::North if self.north_south => Action::South,
            Action::South if self.north_south => Action::North,
            other => other,
        }
    }

    /// The image of a city.
    #[must_use]
    pub fn heights(self, heights: &HeightMap) -> HeightMap {
        let grid = heights.grid();
        let mut mirrored = HeightMap::flat(grid);
        for cell in grid.cells() {
            mirrored.set(self.cell(grid, cell), heights.height_m(cell).unwrap_or(0));
        }
        mirrored
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::Metres;

    #[test]
    fn cells_and_actions_mirror_together() {
        let grid = Grid::new(7, 4, Metres(20.0)).unwrap();
        for mirror in Mirror::ALL {
            for cell in grid.cells() {
                let image = mirror.cell(grid, cell);
                assert!(grid.contains(image));
                assert_eq!(mirror.cell(grid, image), cell);
                for action in Action::ALL {
                    assert_eq!(mirror.cell(grid, cell.after(action)), image.after(mirror.action(action)));
                }
            }
        }
    }
}
