//! Which message passes from one link to the other, after ArduPilot's `MAVLink_routing`: those without a target go
//! wherever somebody has spoken, those with one go where the target has spoken.

use super::{Copter, LinkId};
use crate::wire;
use gleaner_link::{Address, Frame};

/// Who was heard where.
#[derive(Clone, Debug, Default)]
pub(crate) struct Routes(Vec<(Address, LinkId)>);

impl Routes {
    fn learn(&mut self, sender: Address, link: LinkId) {
        match self.0.iter_mut().find(|(address, _)| *address == sender) {
            Some((_, known)) => *known = link,
            None => self.0.push((sender, link)),
        }
    }

    /// Whether a message for `target` goes out on `link`.
    fn leads_to(&self, target: Address, link: LinkId) -> bool {
        self.0.iter().any(|&(address, known)| known == link && target.reaches(address))
    }
}

impl Copter {
    /// Passes a frame on; whether it is (also) for the autopilot itself.
    pub(super) fn route(&mut self, from: LinkId, frame: &Frame) -> bool {
        let own = Address::new(self.settings.system_id, 1);
        if frame.sender == own {
            return false;
        }
        self.routes.learn(frame.sender, from);
        let target = wire::target(frame);
        for link in LinkId::ALL {
            if link != from && self.routes.leads_to(target, link) {
                self.link_mut(link).out.push(wire::relayed(frame));
            }
        }
        target.reaches(own)
    }
}
