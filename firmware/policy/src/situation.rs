//! The inputs of a decision.

use gleaner_units::{BatteryUnits, Cell, Db, Sight};
use serde::{Deserialize, Serialize};

/// Weight of data against energy: `w_data` in 0..=1, and 1 - `w_data` for energy (paper, vector w).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Preference {
    w_data: f32,
}

impl Preference {
    /// Data only.
    pub const DATA: Preference = Preference { w_data: 1.0 };
    /// Energy only.
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

/// Current knowledge of one ground device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceState {
    /// Its cell.
    pub cell: Cell,
    /// Data still to collect, data units: the last report, before that the mission's figure.
    pub remaining: f32,
    /// SNR of a fresh report; `None` without one.
    pub snr: Option<Db>,
}

impl DeviceState {
    /// SNR of a fresh report, dB. One that is not finite counts as missing.
    #[must_use]
    pub fn snr_db(&self) -> Option<f32> {
        self.snr.map(|snr| snr.0).filter(|snr_db| snr_db.is_finite())
    }

    /// Data still to collect, data units. A figure that is not finite or is negative counts as 0.
    #[must_use]
    pub fn remaining_units(&self) -> f32 {
        if self.remaining.is_finite() { self.remaining.max(0.0) } else { 0.0 }
    }
}

/// Deviation of links with line of sight from the nominal channel. The default is the nominal channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelOffset {
    /// Change of the gain at 100 m, dB.
    pub gain_db: f32,
    /// Change of the path-loss exponent.
    pub exponent: f32,
}

impl ChannelOffset {
    /// The nominal channel.
    pub const NONE: ChannelOffset = ChannelOffset { gain_db: 0.0, exponent: 0.0 };
}

/// Everything that a decision depends on, except the devices.
#[derive(Clone, Copy)]
pub struct Situation<'a> {
    /// The aircraft's cell.
    pub cell: Cell,
    /// Battery left.
    pub battery: BatteryUnits,
    /// Battery beyond the distance to the terminal, `b - distance` (paper, b_SC).
    pub spare: BatteryUnits,
    /// The cell that ends the mission.
    pub terminal: Cell,
    /// The operator's preference.
    pub preference: Preference,
    /// Line of sight between ground and flight altitude.
    pub sight: &'a dyn Sight,
    /// The channel behind yield map and vantages.
    pub channel: ChannelOffset,
}
