//! Actions of one slot, and sets of actions.

use crate::BatteryUnits;
use serde::{Deserialize, Serialize};

/// One decision (paper, eq. 2). The discriminants are the order of the model's outputs and of every wire format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum Action {
    /// Stay for one slot.
    Hover = 0,
    /// One cell towards +y.
    North = 1,
    /// One cell towards -x.
    West = 2,
    /// One cell towards -y.
    South = 3,
    /// One cell towards +x.
    East = 4,
}

impl Action {
    /// Number of actions.
    pub const COUNT: usize = 5;
    /// All actions, in contract order.
    pub const ALL: [Action; Action::COUNT] =
        [Action::Hover, Action::North, Action::West, Action::South, Action::East];
    /// The four moves, in contract order.
    pub const MOVES: [Action; 4] = [Action::North, Action::West, Action::South, Action::East];

    /// The action with this contract index.
    #[must_use]
    pub const fn from_index(index: usize) -> Option<Action> {
        match index {
            0 => Some(Action::Hover),
            1 => Some(Action::North),
            2 => Some(Action::West),
            3 => Some(Action::South),
            4 => Some(Action::East),
            _ => None,
        }
    }

    /// The contract index, 0..4.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The change of cell `(east, north)`.
    #[must_use]
    pub const fn offset(self) -> (i16, i16) {
        match self {
            Action::Hover => (0, 0),
            Action::North => (0, 1),
            Action::West => (-1, 0),
            Action::South => (0, -1),
            Action::East => (1, 0),
        }
    }

    /// Energy (paper, eq. 4): half a unit to hover, one unit to move.
    #[must_use]
    pub const fn cost(self) -> BatteryUnits {
        match self {
            Action::Hover => BatteryUnits(0.5),
            _ => BatteryUnits(1.0),
        }
    }

    /// Lower-case name in logs and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Action::Hover => "hover",
            Action::North => "north",
            Action::West => "west",
            Action::South => "south",
            Action::East => "east",
        }
    }
}

/// A set of actions: bit `i` is the action with index `i`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ActionMask(u8);

impl ActionMask {
    /// No action.
    pub const EMPTY: ActionMask = ActionMask(0);
    /// All actions.
    pub const FULL: ActionMask = ActionMask(0b1_1111);

    /// The set with these bits. Bits above the fifth are ignored.
    #[must_use]
    pub const fn from_bits(bits: u8) -> ActionMask {
        ActionMask(bits & 0b1_1111)
    }

    /// Bit `i` is the action with index `i`.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// This set with `action` added.
    #[must_use]
    pub const fn with(self, action: Action) -> ActionMask {
        ActionMask(self.0 | 1 << action.index())
    }

    /// Whether `action` is in the set.
    #[must_use]
    pub const fn allows(self, action: Action) -> bool {
        self.0 & (1 << action.index()) != 0
    }

    /// Number of actions in the set.
    #[must_use]
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether the set is empty.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The members, in contract order.
    pub fn iter(self) -> impl Iterator<Item = Action> {
        Action::ALL.into_iter().filter(move |&action| self.allows(action))
    }

    /// The member with the highest logit, the first of equal ones. `None` if the set is empty or a member's logit is NaN.
    /// Trainer, simulator and aircraft all decide with this function.
    #[must_use]
    pub fn argmax(self, logits: &[f32; Action::COUNT]) -> Option<Action> {
        let mut best: Option<(Action, f32)> = None;
        for (action, &logit) in Action::ALL.into_iter().zip(logits) {
            if !self.allows(action) {
                continue;
            }
            if logit.is_nan() {
                return None;
            }
            if best.is_none_or(|(_, highest)| logit > highest) {
                best = Some((action, logit));
            }
        }
        best.map(|(action, _)| action)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contract_order_is_hover_north_west_south_east() {
        let offsets: [(i16, i16); 5] = Action::ALL.map(Action::offset);
        assert_eq!(offsets, [(0, 0), (0, 1), (-1, 0), (0, -1), (1, 0)]);
        for (index, action) in Action::ALL.into_iter().enumerate() {
            assert_eq!(Action::from_index(index), Some(action));
            assert_eq!(action.index(), index);
        }
        assert_eq!(Action::from_index(5), None);
    }

    #[test]
    fn argmax_stays_inside_the_mask_and_refuses_nan() {
        let mask = ActionMask::EMPTY.with(Action::West).with(Action::East);
        assert_eq!(mask.argmax(&[9.0, 9.0, 1.0, 9.0, 2.0]), Some(Action::East));
        assert_eq!(mask.argmax(&[0.0, 0.0, 1.0, 0.0, 1.0]), Some(Action::West), "first on a tie");
        assert_eq!(mask.argmax(&[f32::NAN, 0.0, 1.0, 0.0, 0.0]), Some(Action::West), "NaN outside the mask");
        assert_eq!(mask.argmax(&[0.0, 0.0, f32::NAN, 0.0, 1.0]), None);
        assert_eq!(mask.argmax(&[0.0, 0.0, f32::NEG_INFINITY, 0.0, f32::NEG_INFINITY]), Some(Action::West));
        assert_eq!(ActionMask::EMPTY.argmax(&[0.0; 5]), None);
        assert_eq!(ActionMask::from_bits(0xFF), ActionMask::FULL);
    }
}
