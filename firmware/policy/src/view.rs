//! The symmetries of the grid: a situation may be turned and mirrored, and the best action turns with it.
//!
//! North is nothing special to a policy that sees offsets and what is heard around it. So the trainer shows it missions
//! turned and mirrored, and it learns to fly to the north what it has flown to the east. In flight there is one view, the
//! plain one.

use gleaner_units::Action;

/// One of the eight symmetries of a square: mirrored or not along each axis, then the axes exchanged or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct View {
    mirrors_east: bool,
    mirrors_north: bool,
    exchanges: bool,
}

impl View {
    /// All of them; the first changes nothing.
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

    /// Where this offset (east, north) lies in the view.
    #[must_use]
    pub fn offset(self, [east, north]: [f32; 2]) -> [f32; 2] {
        let east = if self.mirrors_east { -east } else { east };
        let north = if self.mirrors_north { -north } else { north };
        if self.exchanges { [north, east] } else { [east, north] }
    }

    /// Where the number at (column, row) of a square map with this side lies in the view.
    #[must_use]
    pub const fn place(self, [column, row]: [usize; 2], side: usize) -> [usize; 2] {
        let column = if self.mirrors_east { side - 1 - column } else { column };
        let row = if self.mirrors_north { side - 1 - row } else { row };
        if self.exchanges { [row, column] } else { [column, row] }
    }

    /// What this action is called in the view.
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
    fn actions_offsets_and_maps_turn_together() {
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
    fn there_are_eight_and_the_first_is_plain() {
        let images = View::ALL.map(|view| view.offset([1.0, 2.0]));
        for (index, image) in images.iter().enumerate() {
            assert!(!images[..index].contains(image));
        }
        assert_eq!(images[0], [1.0, 2.0]);
    }
}
