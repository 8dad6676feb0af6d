//! The parameters of the product: names, ranges, defaults and values. Ground stations and settings files go
//! through the same [`Parameters::set`].

mod encoding;
mod table;

pub(crate) use encoding::decode;
pub use table::{PARAMETERS, ParameterId, ParameterSpec};

use core::fmt;
use gleaner_units::{BatteryUnits, Decimal, Duration, Metres, MetresPerSecond};
use table::COUNT;

/// `GLN_ENABLE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Enable {
    /// Do nothing.
    Off,
    /// Engage when the autopilot is in GUIDED or OFFBOARD.
    Engage,
    /// Decide and log, command nothing.
    Shadow,
}

impl Enable {
    /// From 0, 1 or 2 exactly.
    #[must_use]
    pub fn from_value(value: f32) -> Option<Enable> {
        [Enable::Off, Enable::Engage, Enable::Shadow].into_iter().find(|enable| enable.value() == value)
    }

    /// The parameter's value.
    #[must_use]
    pub const fn value(self) -> f32 {
        match self {
            Enable::Off => 0.0,
            Enable::Engage => 1.0,
            Enable::Shadow => 2.0,
        }
    }
}

/// A value that was set, perhaps to what it was before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Which.
    pub id: ParameterId,
    /// Value before.
    pub old: f32,
    /// Value now.
    pub new: f32,
}

/// Why a value was not set. The old value stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterError {
    /// There is no parameter of that name.
    Unknown,
    /// NaN or infinite.
    NotFinite(ParameterId),
    /// Outside its range.
    OutOfRange(ParameterId),
    /// Not a whole number.
    NotWhole(ParameterId),
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ParameterError::Unknown => write!(f, "no such parameter"),
            ParameterError::NotFinite(id) => write!(f, "{} must be a number", id.spec().name),
            ParameterError::OutOfRange(id) => {
                let spec = id.spec();
                // Every bound prints exactly in tenths.
                let (min, max) = (Decimal::<1>(spec.min), Decimal::<1>(spec.max));
                write!(f, "{} must be {min:#}..{max:#} {}", spec.name, spec.unit)
            }
            ParameterError::NotWhole(id) => write!(f, "{} must be a whole number", id.spec().name),
        }
    }
}

impl core::error::Error for ParameterError {}

/// The values. Always inside their ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    values: [f32; COUNT],
}

impl Default for Parameters {
    fn default() -> Parameters {
        Parameters { values: PARAMETERS.map(|spec| spec.default) }
    }
}

impl Parameters {
    /// Sets a value by name: what `PARAM_SET` and settings files do.
    ///
    /// # Errors
    /// See [`ParameterError`]; values are never clamped.
    pub fn set(&mut self, name: &str, value: f32) -> Result<Change, ParameterError> {
        let id = ParameterId::from_name(name).ok_or(ParameterError::Unknown)?;
        self.set_id(id, value)
    }

    /// [`Parameters::set`] without the search for the name.
    ///
    /// # Errors
    /// As [`Parameters::set`], but never [`ParameterError::Unknown`].
    pub fn set_id(&mut self, id: ParameterId, value: f32) -> Result<Change, ParameterError> {
        let spec = id.spec();
        if !value.is_finite() {
            return Err(ParameterError::NotFinite(id));
        }
        if !(spec.min..=spec.max).contains(&value) {
            return Err(ParameterError::OutOfRange(id));
        }
        if spec.whole && value as i32 as f32 != value {
            return Err(ParameterError::NotWhole(id));
        }
        let old = self.value(id);
        if let Some(slot) = self.values.get_mut(id as usize) {
            // Adding zero turns -0 into 0, so equal values have equal bytes on the wire.
            *slot = value + 0.0;
        }
        Ok(Change { id, old, new: self.value(id) })
    }

    /// One value as it travels.
    #[must_use]
    pub fn value(&self, id: ParameterId) -> f32 {
        self.values.get(id as usize).copied().unwrap_or(id.spec().default)
    }

    /// Weight of data in the preference, 0..1.
    #[must_use]
    pub fn data_weight(&self) -> f32 {
        self.value(ParameterId::DataWeight)
    }

    /// Off, engage or shadow.
    #[must_use]
    pub fn enable(&self) -> Enable {
        Enable::from_value(self.value(ParameterId::Enable)).unwrap_or(Enable::Off)
    }

    /// Flight altitude above the take-off point.
    #[must_use]
    pub fn altitude(&self) -> Metres {
        Metres(self.value(ParameterId::Altitude))
    }

    /// Horizontal speed, commanded to the autopilot.
    #[must_use]
    pub fn speed(&self) -> MetresPerSecond {
        MetresPerSecond(self.value(ParameterId::Speed))
    }

    /// Battery units kept beyond the way home.
    #[must_use]
    pub fn reserve(&self) -> BatteryUnits {
        BatteryUnits(self.value(ParameterId::Reserve))
    }

    /// Battery units of a full battery.
    #[must_use]
    pub fn full_battery(&self) -> BatteryUnits {
        BatteryUnits(self.value(ParameterId::FullBattery))
    }

    /// Arrival radius of a cell centre.
    #[must_use]
    pub fn arrive_radius(&self) -> Metres {
        Metres(self.value(ParameterId::ArriveRadius))
    }

    /// Reports older than this are masked.
    #[must_use]
    pub fn snr_age(&self) -> Duration {
        Duration::from_secs_f32(self.value(ParameterId::SnrAge))
    }

    /// Whether the network looks ahead in the on-board model.
    #[must_use]
    pub fn looks_ahead(&self) -> bool {
        self.value(ParameterId::Lookahead) != 0.0
    }

    /// Number of the installed model that is chosen; -1 for the one before.
    #[must_use]
    pub fn model(&self) -> i8 {
        self.value(ParameterId::Model) as i8
    }

    /// RC channel mapped to the preference, counted from 1.
    #[must_use]
    pub fn data_weight_channel(&self) -> Option<u8> {
        let channel = self.value(ParameterId::DataWeightChannel) as u8;
        (channel != 0).then_some(channel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    #[test]
    fn the_table_is_in_order_and_its_defaults_valid() {
        let mut parameters = Parameters::default();
        for (index, spec) in PARAMETERS.iter().enumerate() {
            assert_eq!(spec.id as usize, index);
            assert_eq!(spec.id.spec(), *spec);
            assert_eq!(ParameterId::from_index(spec.id.index()), Some(spec.id));
            assert!(spec.name.len() <= 16 && spec.name.starts_with("GLN_"), "{}", spec.name);
            for value in [spec.default, spec.min, spec.max] {
                assert_eq!(
                    parameters.set(spec.name, value).map(|change| change.new),
                    Ok(value),
                    "{}",
                    spec.name
                );
            }
        }
        assert_eq!(ParameterId::from_index(11), None);
    }

    #[test]
    fn refused_values_change_nothing() {
        let mut parameters = Parameters::default();
        let mut refuse = |name: &str, value: f32| {
            let before = parameters.clone();
            let error = parameters.set(name, value).unwrap_err();
            assert_eq!(parameters, before);
            error.to_string()
        };
        assert_eq!(refuse("GLN_W_DATA", f32::NAN), "GLN_W_DATA must be a number");
        assert_eq!(refuse("GLN_ALT", f32::INFINITY), "GLN_ALT must be a number");
        assert_eq!(refuse("GLN_ALT", 120.01), "GLN_ALT must be 20..120 m");
        assert_eq!(refuse("GLN_ARRIVE_R", 0.4), "GLN_ARRIVE_R must be 0.5..10 m");
        assert_eq!(refuse("GLN_ENABLE", 1.5), "GLN_ENABLE must be a whole number");
        assert_eq!(refuse("GLN_W_RC", 18.5), "GLN_W_RC must be 0..18 ");
        assert_eq!(refuse("gln_alt", 60.0), "no such parameter");
    }

    proptest! {
        #![proptest_config(crate::seeded())]

        #[test]
        fn values_stay_in_their_ranges(asks in proptest::collection::vec((0u16..11, any::<f32>()), 0..40)) {
            let mut parameters = Parameters::default();
            for (index, value) in asks {
                let id = ParameterId::from_index(index).unwrap();
                let set = parameters.set_id(id, value);
                let spec = id.spec();
                let allowed = value >= spec.min && value <= spec.max && (!spec.whole || value.fract() == 0.0);
                prop_assert_eq!(set.is_ok(), allowed);
                prop_assert!((spec.min..=spec.max).contains(&parameters.value(id)));
            }
            prop_assert!(Enable::from_value(parameters.value(ParameterId::Enable)).is_some());
            prop_assert!(parameters.data_weight_channel().is_none_or(|channel| (1..=18).contains(&channel)));
        }
    }
}
