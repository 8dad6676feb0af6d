//! What the aircraft knows when it decides.

use gleaner_units::{BatteryUnits, Cell, Db, Sight};
use serde::{Deserialize, Serialize};

/// How much data is worth against energy: `w_data` in 0..=1, energy gets the rest (paper, vector w).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Preference {
    w_data: f32,
}

impl Preference {
    /// All for data.
    pub const DATA: Preference = Preference { w_data: 1.0 };
    /// All for energy.
    pub const ENERGY: Preference = Preference { w_data: 0.0 };

    /// The preference with this weight of data; `None` for NaN and outside 0..=1.
    #[must_use]
    pub fn new(w_data: f32) -> Option<Preference> {
        (0.0..=1.0).contains(&w_data).then_some(Preference { w_data })
    }

    /// Weight of data.
    #[must_use]
    pub const fn w_data(self) -> f32 {
        self.w_data
    }

    /// Weight of energy.
    #[must_use]
    pub fn w_energy(self) -> f32 {
        1.0 - self.w_data
    }
}

/// One ground device as it is known now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceState {
    /// Where it stands.
    pub cell: Cell,
    /// Data still to collect, data units: the last that was reported, at first what the mission says.
    pub remaining: f32,
    /// SNR of a report that is fresh enough; `None` when it is not heard.
    pub snr: Option<Db>,
}

/// Everything a decision depends on.
#[derive(Clone, Copy)]
pub struct Situation<'a> {
    /// The cell that the aircraft is in.
    pub cell: Cell,
    /// Battery left.
    pub battery: BatteryUnits,
    /// Battery beyond the way to the terminal, `b - distance` (paper, b_SC).
    pub spare: BatteryUnits,
    /// The cell that ends the mission.
    pub terminal: Cell,
    /// The operator's preference.
    pub preference: Preference,
    /// The city from flight altitude: who is seen from where.
    pub sight: &'a dyn Sight,
}
