//! Requests that PX4 answers in its own way.

use super::super::LinkId;
use super::super::requests;
use super::Px4;
use mavlink::dialects::ardupilotmega::{MavParamType, PARAM_SET_DATA};

impl Px4 {
    /// Integers arrive as the raw bits of an int32 in the float field.
    pub(super) fn set_parameter_from_wire(&mut self, set: &PARAM_SET_DATA) {
        let name = set.param_id.to_str().unwrap_or_default();
        let integer = set.param_type == MavParamType::MAV_PARAM_TYPE_INT32;
        let value = if integer { set.param_value.to_bits().cast_signed() as f32 } else { set.param_value };
        let Some(index) = self.vehicle.parameters.index(name) else { return };
        // A type that is not the parameter's is refused: the old value is sent.
        if self.vehicle.parameters.at(index).is_some_and(|parameter| parameter.kind == set.param_type) {
            requests::set_parameter(self, name, value);
        }
        requests::send_parameter(self, &LinkId::ALL, index);
    }
}
