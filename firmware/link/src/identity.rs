//! Which system we belong to (MAVLink guide, "Component Identification").

use crate::Address;
use gleaner_units::{Duration, Instant};
use heapless::Vec;

/// How the system id was settled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Settled {
    /// One autopilot was heard: its system id was taken over.
    Adopted(u8),
    /// Several were heard: the configured id stays.
    Several,
}

/// Adopts the vehicle's system id: exactly one autopilot within three seconds of the first.
#[derive(Clone, Debug)]
pub struct Identity {
    own: Address,
    first_heard_at: Option<Instant>,
    systems: Vec<u8, 4>,
    settled: Option<Settled>,
}

impl Identity {
    const WINDOW: Duration = Duration::from_secs(3);

    /// The identity to start with.
    pub const fn new(configured: Address) -> Identity {
        Identity { own: configured, first_heard_at: None, systems: Vec::new(), settled: None }
    }

    /// Our address as it is now.
    pub const fn own(&self) -> Address {
        self.own
    }

    /// How the question was settled, if it is.
    pub const fn settled(&self) -> Option<Settled> {
        self.settled
    }

    /// An autopilot's heartbeat arrived from `system`.
    pub fn hear(&mut self, now: Instant, system: u8) {
        if self.settled.is_some() || system == 0 {
            return;
        }
        self.first_heard_at.get_or_insert(now);
        if !self.systems.contains(&system) {
            // A fifth one changes nothing: there are several already.
            let _ = self.systems.push(system);
        }
    }

    /// Settles the question when the window is over; tells it once.
    pub fn poll(&mut self, now: Instant) -> Option<Settled> {
        let first = self.first_heard_at?;
        if self.settled.is_some() || now.since(first) < Identity::WINDOW {
            return None;
        }
        self.settled = match self.systems.as_slice() {
            [one] => {
                self.own.system = *one;
                Some(Settled::Adopted(*one))
            }
            _ => Some(Settled::Several),
        };
        self.settled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIGURED: Address = Address::new(1, 191);

    #[test]
    fn the_only_autopilot_gives_its_system_id() {
        let mut identity = Identity::new(CONFIGURED);
        assert_eq!(identity.poll(Instant::from_millis(60_000)), None, "nobody heard");
        identity.hear(Instant::from_millis(61_000), 42);
        identity.hear(Instant::from_millis(62_000), 42);
        assert_eq!(identity.poll(Instant::from_millis(63_999)), None);
        assert_eq!(identity.poll(Instant::from_millis(64_000)), Some(Settled::Adopted(42)));
        assert_eq!(identity.own(), Address::new(42, 191));
        identity.hear(Instant::from_millis(65_000), 7);
        assert_eq!(identity.poll(Instant::from_millis(80_000)), None, "told once");
        assert_eq!(identity.own(), Address::new(42, 191));
    }

    #[test]
    fn several_autopilots_leave_the_configured_id() {
        let mut identity = Identity::new(CONFIGURED);
        for system in [3, 4, 5, 6, 7, 8] {
            identity.hear(Instant::ZERO, system);
        }
        assert_eq!(identity.poll(Instant::from_millis(3_000)), Some(Settled::Several));
        assert_eq!(identity.own(), CONFIGURED);
    }
}
