//! Addresses of senders and receivers.

use core::fmt;

/// A MAVLink address, written `SYSTEM/COMPONENT`. In a target, 0 stands for all systems or all components.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Address {
    /// System id: one vehicle or one ground station.
    pub system: u8,
    /// Component id within the system.
    pub component: u8,
}

impl Address {
    /// All components of all systems.
    pub const ALL: Address = Address { system: 0, component: 0 };

    /// The address with these ids.
    #[must_use]
    pub const fn new(system: u8, component: u8) -> Address {
        Address { system, component }
    }

    /// Whether a message to this target is for `own`: broadcast, to our system as a whole, or to us
    /// (MAVLink guide, "Routing").
    #[must_use]
    pub const fn reaches(self, own: Address) -> bool {
        (self.system == 0 || self.system == own.system)
            && (self.component == 0 || self.component == own.component)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.system, self.component)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broadcast_system_and_exact_targets_reach_us() {
        let own = Address::new(7, 191);
        for target in [Address::ALL, Address::new(7, 0), Address::new(7, 191), Address::new(0, 191)] {
            assert!(target.reaches(own), "{target:?}");
        }
        for target in [Address::new(7, 1), Address::new(8, 191), Address::new(8, 0)] {
            assert!(!target.reaches(own), "{target:?}");
        }
    }
}
