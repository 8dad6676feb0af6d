//! The parameter protocol over [`Parameters`].

use crate::{Outgoing, PARAMETERS, Packet, ParameterId, Parameters, Priority};
use mavlink::dialects::ardupilotmega::{MavParamType, PARAM_VALUE_DATA};

/// Which values are still to be told. A value is told as it is when it leaves, so asking twice costs nothing.
#[derive(Debug, Default)]
pub(crate) struct ParameterService {
    to_tell: u16,
}

impl ParameterService {
    /// Values per poll, so that a list does not crowd out setpoints and acknowledgements.
    const PER_POLL: usize = 3;
    /// Room that is left to acknowledgements.
    const MARGIN: usize = 8;

    /// All values are to be told.
    pub fn tell_all(&mut self) {
        self.to_tell = (1 << PARAMETERS.len()) - 1;
    }

    /// One value is to be told.
    pub fn tell(&mut self, id: ParameterId) {
        self.to_tell |= 1 << id.index();
    }

    /// Tells some values.
    pub fn poll(&mut self, parameters: &Parameters, out: &mut Outgoing) {
        for _ in 0..ParameterService::PER_POLL {
            let next = ParameterId::from_index(self.to_tell.trailing_zeros() as u16);
            let Some(id) = next.filter(|_| out.urgent_room() > ParameterService::MARGIN) else { return };
            self.to_tell &= !(1 << id.index());
            if let Some(packet) = value_packet(id, parameters) {
                out.push(Priority::Urgent, packet);
            }
        }
    }
}

fn value_packet(id: ParameterId, parameters: &Parameters) -> Option<Packet> {
    Packet::new(&PARAM_VALUE_DATA {
        param_value: parameters.value(id),
        param_count: PARAMETERS.len() as u16,
        param_index: id.index(),
        param_id: id.spec().name.into(),
        // The one type that both autopilots' rules encode alike.
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    })
}
