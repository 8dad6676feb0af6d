//! The symmetries of the grid: rotating or mirroring a situation does the same to its best action.
//!
//! The inputs of the policy are offsets and coverage, which have no preferred direction. The trainer therefore presents
//! rotated and mirrored missions, so that experience in one direction serves all. In flight only the identity is used.

use gleaner_units::Action;

/// One of the eight symmetries of a square: an optional mirroring of each axis, then an optional exchange of the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct View {
    mirrors_east: bool,
    mirrors_north: bool,
    exchanges: bool,
}

impl View {
    /// All symmetries; the first is the identity.
    pub const ALL: [View; 8] = [
        View::numbered(0),
        View::numbered(1),
        View::numbered(2),
        View::numbered(3),
        View::numbered(4),
        View::numbered(5),
        View::numbered(6),
        View::numbered(7),
    ];

    const fn numbered(bits: u8) -> View {
        View { mirrors_east: bits & 1 != 0, mirrors_north: bits & 2 != 0, exchanges: bits & 4 != 0 }
    }

    /// The image of an offset (east, north).
    #[must_use]
    pub fn offset(self, [east, north]: [f32; 2]) -> [f32; 2] {
        let east = if self.mirrors_east { -east } else { east };
        let north = if self.mirrors_north { -north } else { north };
        if self.exchanges { [north, east] } else { [east, north] }
    }

    /// The image of (column, row) in a square map of `side` columns.
    #[must_use]
    pub const fn place(self, [column, row]: [usize; 2], side: usize) -> [usize; 2] {
        let column = if self.mirrors_east { side - 1 - column } else { column };
        let row = if self.mirrors_north { side - 1 - row } else { row };
        if self.exchanges { [row, column] } else { [column, row] }
    }

    /// The image of an action.
    #[must_use]
    pub fn action(self, action: Action) -> Action {
        let mirrored = match action {
            Action::East if self.mirrors_east => Action::West,
            Action::West if self.mirrors_east => Action::East,
            Action::North if self.mirrors_north => Action::South,
            Action::South if self.mirrors_north => Action::North,
            other => other,
        };
        match mirrored {
            Action::East if self.exchanges => Action::North,
            Action::North if self.exchanges => Action::East,
            Action::West if self.exchanges => Action::South,
            Action::South if self.exchanges => Action::West,
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(action: Action) -> [f32; 2] {
        match action {
            Action::Hover => [0.0, 0.0],
            Action::North => [0.0, 1.0],
            Action::West => [-1.0, 0.0],
            Action::South => [0.0, -1.0],
            Action::East => [1.0, 0.0],
        }
    }

    #[test]
    fn actions_offsets_and_maps_transform_alike() {
        for view in View::ALL {
            for action in Action::ALL {
                let [east, north] = step(action);
                assert_eq!(view.offset([east, north]), step(view.action(action)), "{view:?} {action:?}");
                let place = [(2.0 + east) as usize, (2.0 + north) as usize];
                let [seen_east, seen_north] = step(view.action(action));
                let seen = [(2.0 + seen_east) as usize, (2.0 + seen_north) as usize];
                assert_eq!(view.place(place, 5), seen, "{view:?} {action:?}");
            }
        }
    }

    #[test]
    fn eight_distinct_views_beginning_with_the_identity() {
        let images = View::ALL.map(|view| view.offset([1.0, 2.0]));
        for (index, image) in images.iter().enumerate() {
            assert!(!images[..index].contains(image));
        }
        assert_eq!(images[0], [1.0, 2.0]);
    }
}
