//! The autopilot's own parameters: those that the simulation obeys, and those that ground stations look for.

use mavlink::dialects::ardupilotmega::MavParamType;

/// One parameter, as its number. How an integer travels in `PARAM_VALUE` depends on the autopilot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameter {
    pub name: &'static str,
    pub value: f32,
    pub kind: MavParamType,
}

/// Names, default values and types, in index order.
pub(super) type Defaults = &'static [(&'static str, f32, MavParamType)];

/// The table of one autopilot.
#[derive(Clone, Debug)]
pub(super) struct ParameterTable(Vec<Parameter>);

impl ParameterTable {
    pub fn new(defaults: Defaults) -> ParameterTable {
        let parameter = |&(name, value, kind)| Parameter { name, value, kind };
        ParameterTable(defaults.iter().map(parameter).collect())
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

    /// Sets a value; the index of the parameter, `None` for an unknown name. A value that is not finite changes
    /// nothing; integers are truncated.
    pub fn set(&mut self, name: &str, value: f32) -> Option<usize> {
        let index = self.index(name)?;
        let parameter = &mut self.0[index];
        if value.is_finite() {
            let is_float = parameter.kind == MavParamType::MAV_PARAM_TYPE_REAL32;
            parameter.value = if is_float { value } else { value.trunc() };
        }
        Some(index)
    }

    /// The value of a parameter that is in the table.
    pub fn value(&self, name: &'static str) -> f64 {
        self.index(name).map_or(0.0, |index| f64::from(self.0[index].value))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ardupilot, px4};
    use super::*;

    #[test]
    fn names_fit_the_wire_and_are_unique() {
        for defaults in [ardupilot::DEFAULTS, px4::DEFAULTS] {
            for (index, (name, ..)) in defaults.iter().enumerate() {
                assert!(name.len() <= 16, "{name}");
                assert_eq!(ParameterTable::new(defaults).index(name), Some(index));
            }
        }
    }

    #[test]
    fn integers_are_truncated_and_nan_changes_nothing() {
        let mut table = ParameterTable::new(ardupilot::DEFAULTS);
        table.set("FENCE_ENABLE", 1.7);
        table.set("WPNAV_SPEED", f32::NAN);
        assert_eq!((table.value("FENCE_ENABLE"), table.value("WPNAV_SPEED")), (1.0, 1000.0));
        assert_eq!(table.set("NO_SUCH_NAME", 1.0), None);
    }
}
