//! The parameter protocol over [`Parameters`].

use crate::parameters::{PARAMETERS, ParameterId, Parameters};
use crate::wire::outgoing::{Outgoing, Priority};
use crate::wire::packet::Packet;
use mavlink::dialects::ardupilotmega::{MavParamType, PARAM_VALUE_DATA};

/// The values that are still to be sent. A value is read when it leaves, so a second request for it is free.
#[derive(Debug, Default)]
pub(crate) struct ParameterService {
    to_send: u16,
}

impl ParameterService {
    /// Values per poll, so that a list does not crowd out setpoints and acknowledgements.
    const PER_POLL: usize = 3;
    /// Room left for acknowledgements.
    const MARGIN: usize = 8;

    /// Queues all values.
    pub fn send_all(&mut self) {
        self.to_send = (1 << PARAMETERS.len()) - 1;
    }

    /// Queues one value.
    pub fn send(&mut self, id: ParameterId) {
        self.to_send |= 1 << id.index();
    }

    /// Sends some of the queued values.
    pub fn poll(&mut self, parameters: &Parameters, out: &mut Outgoing) {
        for _ in 0..ParameterService::PER_POLL {
            let next = ParameterId::from_index(self.to_send.trailing_zeros() as u16);
            let Some(id) = next.filter(|_| out.urgent_room() > ParameterService::MARGIN) else { return };
            self.to_send &= !(1 << id.index());
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
        // The only type that ArduPilot and PX4 encode alike.
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    })
}
