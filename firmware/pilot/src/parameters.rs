//! The parameters of the pilot, checked: what a value may be is decided here and nowhere else.

use core::fmt;
use gleaner_policy::Preference;
use gleaner_units::{BatteryUnits, Duration, Metres, MetresPerSecond};

/// What the operator wants the pilot to do (`GLN_ENABLE`, `MAV_CMD_USER_2`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Enable {
    /// Nothing.
    #[default]
    Off = 0,
    /// Fly as soon as everything is in place.
    Engage = 1,
    /// Decide and log, command nothing.
    Shadow = 2,
}

impl Enable {
    /// The request with this number; `None` for any other number.
    #[must_use]
    pub fn from_value(value: f32) -> Option<Enable> {
        [Enable::Off, Enable::Engage, Enable::Shadow].into_iter().find(|enable| enable.value() == value)
    }

    /// The number on the wire.
    #[must_use]
    pub fn value(self) -> f32 {
        f32::from(self as u8)
    }
}

/// One parameter as a ground station sees it. All travel as `MAV_PARAM_TYPE_REAL32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterSpec {
    /// At most 16 characters.
    pub name: &'static str,
    /// Lowest value.
    pub low: f32,
    /// Highest value.
    pub high: f32,
    /// Value without a configuration.
    pub default: f32,
    /// Whether only whole numbers are allowed.
    pub whole: bool,
    /// Unit, empty for a plain number.
    pub unit: &'static str,
    /// One line for a human.
    pub meaning: &'static str,
}

const fn spec(
    name: &'static str,
    (low, high, default): (f32, f32, f32),
    whole: bool,
    unit: &'static str,
    meaning: &'static str,
) -> ParameterSpec {
    ParameterSpec { name, low, high, default, whole, unit, meaning }
}

/// All parameters, in index order. The order and the count never change after boot.
pub const PARAMETERS: [ParameterSpec; 9] = [
    spec("GLN_W_DATA", (0.0, 1.0, 0.5), false, "", "preference: weight of data; energy gets the rest"),
    spec("GLN_ENABLE", (0.0, 2.0, 0.0), true, "", "0 off, 1 engage, 2 shadow"),
    spec("GLN_ALT", (20.0, 120.0, 60.0), false, "m", "flight altitude above the take-off point"),
    spec("GLN_SPEED", (1.0, 20.0, 10.0), false, "m/s", "horizontal speed asked of the autopilot"),
    spec("GLN_RESERVE", (0.0, 50.0, 2.0), false, "battery units", "kept back on top of the way home"),
    spec("GLN_BAT_UNITS", (1.0, 500.0, 100.0), false, "battery units", "what a full battery is worth"),
    spec("GLN_ARRIVE_R", (0.5, 10.0, 2.0), false, "m", "arrival radius of a cell centre"),
    spec("GLN_SNR_AGE", (1.0, 600.0, 30.0), false, "s", "older radio reports are masked"),
    spec("GLN_W_RC", (0.0, 18.0, 0.0), true, "", "RC channel for the preference, 0 none"),
];

/// Why a value was refused. The old value stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterError {
    /// No parameter has this name.
    Unknown,
    /// Outside the range, not a number, or not whole where it must be.
    Range(ParameterSpec),
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ParameterError::Unknown => write!(f, "no such parameter"),
            ParameterError::Range(spec) => {
                let whole = if spec.whole { " whole" } else { "" };
                write!(f, "{} wants{whole} {}..{}", spec.name, spec.low, spec.high)
            }
        }
    }
}

impl core::error::Error for ParameterError {}

impl ParameterSpec {
    /// Whether the parameter may have this value.
    #[must_use]
    pub fn allows(&self, value: f32) -> bool {
        // Written so that NaN is refused.
        value >= self.low && value <= self.high && !(self.whole && libm::truncf(value) != value)
    }
}

/// The values, each inside its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    values: [f32; PARAMETERS.len()],
}

impl Default for Parameters {
    fn default() -> Parameters {
        Parameters { values: PARAMETERS.map(|spec| spec.default) }
    }
}

impl Parameters {
    /// The index of a name, for [`Parameters::set`].
    #[must_use]
    pub fn index(name: &str) -> Option<usize> {
        PARAMETERS.iter().position(|spec| spec.name == name)
    }

    /// The value of a parameter by name.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<f32> {
        self.values.get(Parameters::index(name)?).copied()
    }

    /// Sets a parameter by name.
    ///
    /// # Errors
    /// See [`ParameterError`]; nothing is clamped.
    pub fn set(&mut self, name: &str, value: f32) -> Result<(), ParameterError> {
        let index = Parameters::index(name).ok_or(ParameterError::Unknown)?;
        let (Some(spec), Some(slot)) = (PARAMETERS.get(index), self.values.get_mut(index)) else {
            return Err(ParameterError::Unknown);
        };
        if !spec.allows(value) {
            return Err(ParameterError::Range(*spec));
        }
        *slot = value;
        Ok(())
    }

    /// `GLN_W_DATA`.
    #[must_use]
    pub fn preference(&self) -> Preference {
        let [w_data, ..] = self.values;
        Preference::new(w_data).unwrap_or(Preference::ENERGY)
    }

    /// `GLN_ENABLE`.
    #[must_use]
    pub fn enable(&self) -> Enable {
        let [_, enable, ..] = self.values;
        Enable::from_value(enable).unwrap_or_default()
    }

    /// `GLN_ALT`, above home.
    #[must_use]
    pub fn altitude(&self) -> Metres {
        let [_, _, altitude, ..] = self.values;
        Metres(altitude)
    }

    /// `GLN_SPEED`.
    #[must_use]
    pub fn speed(&self) -> MetresPerSecond {
        let [_, _, _, speed, ..] = self.values;
        MetresPerSecond(speed)
    }

    /// `GLN_RESERVE`.
    #[must_use]
    pub fn reserve(&self) -> BatteryUnits {
        let [.., reserve, _, _, _, _] = self.values;
        BatteryUnits(reserve)
    }

    /// `GLN_BAT_UNITS`.
    #[must_use]
    pub fn full_battery(&self) -> BatteryUnits {
        let [.., full, _, _, _] = self.values;
        BatteryUnits(full)
    }

    /// `GLN_ARRIVE_R`.
    #[must_use]
    pub fn arrive_radius(&self) -> Metres {
        let [.., radius, _, _] = self.values;
        Metres(radius)
    }

    /// `GLN_SNR_AGE`.
    #[must_use]
    pub fn snr_age(&self) -> Duration {
        let [.., age_s, _] = self.values;
        Duration::from_secs_f32(age_s)
    }

    /// `GLN_W_RC`; `None` for 0.
    #[must_use]
    pub fn rc_channel(&self) -> Option<u8> {
        let [.., channel] = self.values;
        (channel >= 1.0).then_some(channel as u8)
    }
}
