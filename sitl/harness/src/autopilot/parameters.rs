//! The autopilot's own parameters: the few that this simulation obeys, and those that ground stations look for.

use mavlink::dialects::ardupilotmega::MavParamType;

/// One parameter. ArduPilot sends integers by C cast, so all values are floats here.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parameter {
    pub name: &'static str,
    pub value: f32,
    pub kind: MavParamType,
}

use MavParamType::MAV_PARAM_TYPE_REAL32 as F32;
use MavParamType::{MAV_PARAM_TYPE_INT8 as I8, MAV_PARAM_TYPE_INT16 as I16, MAV_PARAM_TYPE_INT32 as I32};

/// Defaults of ArduCopter 4.6.
const DEFAULTS: [(&str, f32, MavParamType); 25] = [
    ("SYSID_THISMAV", 1.0, I16),
    ("SYSID_MYGCS", 255.0, I16),
    ("WPNAV_SPEED", 1000.0, F32),
    ("WPNAV_SPEED_UP", 250.0, F32),
    ("WPNAV_SPEED_DN", 150.0, F32),
    ("WPNAV_ACCEL", 250.0, F32),
    ("WPNAV_RADIUS", 200.0, F32),
    ("LAND_SPEED", 50.0, I16),
    ("LAND_ALT_LOW", 1000.0, I16),
    ("RTL_ALT", 1500.0, I32),
    ("RTL_LOIT_TIME", 5000.0, I32),
    ("GUID_TIMEOUT", 3.0, F32),
    ("GUID_OPTIONS", 0.0, I32),
    ("DISARM_DELAY", 10.0, I8),
    ("ARMING_CHECK", 1.0, I32),
    ("FENCE_ENABLE", 0.0, I8),
    ("FENCE_TYPE", 7.0, I8),
    ("FENCE_RADIUS", 300.0, F32),
    ("FENCE_ALT_MAX", 100.0, F32),
    ("BATT_CAPACITY", 3300.0, I32),
    ("BATT_LOW_VOLT", 10.5, F32),
    ("BATT_LOW_TIMER", 10.0, I8),
    ("BATT_FS_LOW_ACT", 0.0, I8),
    ("BATT_CRT_VOLT", 0.0, F32),
    ("BATT_FS_CRT_ACT", 0.0, I8),
];

/// The table, in index order.
#[derive(Clone, Debug)]
pub(crate) struct ParameterTable(Vec<Parameter>);

impl ParameterTable {
    pub fn new(system_id: u8) -> ParameterTable {
        let mut table = ParameterTable(
            DEFAULTS.into_iter().map(|(name, value, kind)| Parameter { name, value, kind }).collect(),
        );
        table.set("SYSID_THISMAV", f32::from(system_id));
        table
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn index(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|parameter| parameter.name == name)
    }

    pub fn at(&self, index: usize) -> Option<&Parameter> {
        self.0.get(index)
    }

    /// Sets a value; the index of the parameter, `None` if there is none of this name.
    pub fn set(&mut self, name: &str, value: f32) -> Option<usize> {
        let index = self.index(name)?;
        let parameter = &mut self.0[index];
        // ArduPilot refuses numbers that are not finite and keeps the old value.
        if value.is_finite() {
            parameter.value = if parameter.kind == F32 { value } else { value.trunc() };
        }
        Some(index)
    }

    /// The value of a parameter of [`DEFAULTS`].
    pub fn value(&self, name: &'static str) -> f64 {
        self.index(name).map_or(0.0, |index| f64::from(self.0[index].value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fit_the_wire_and_are_unique() {
        for (index, (name, ..)) in DEFAULTS.iter().enumerate() {
            assert!(name.len() <= 16, "{name}");
            assert_eq!(ParameterTable::new(1).index(name), Some(index));
        }
    }

    #[test]
    fn integers_are_cut_and_nan_changes_nothing() {
        let mut table = ParameterTable::new(7);
        assert_eq!(table.value("SYSID_THISMAV"), 7.0);
        table.set("FENCE_ENABLE", 1.7);
        table.set("WPNAV_SPEED", f32::NAN);
        assert_eq!((table.value("FENCE_ENABLE"), table.value("WPNAV_SPEED")), (1.0, 1000.0));
        assert_eq!(table.set("NO_SUCH_THING", 1.0), None);
    }
}
