//! The system that we belong to (MAVLink guide, "Component Identification").

use crate::address::Address;
use gleaner_units::{Duration, Instant};
use heapless::Vec;

/// How the system id was decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Settled {
    /// The settings name it.
    Configured(u8),
    /// Exactly one autopilot was heard; its system id is ours.
    Adopted(u8),
    /// Several autopilots were heard and the settings name none: none is served.
    Several,
}

/// Decides the system id: the configured one, or that of the only autopilot heard within three seconds of the first
/// heartbeat.
#[derive(Clone, Debug)]
pub struct Identity {
    own: Address,
    is_configured: bool,
    first_heard_at: Option<Instant>,
    heard: Vec<(u8, Instant), 4>,
    settled: Option<Settled>,
    is_announced: bool,
}

impl Identity {
    const WINDOW: Duration = Duration::from_secs(3);
    /// An autopilot that was silent for this long is gone.
    const GONE: Duration = Duration::from_secs(10);
    /// The id to speak with until one is known.
    const FIRST: u8 = 1;

    /// Before anything was heard. `system` is the configured id.
    pub fn new(system: Option<u8>, component: u8) -> Identity {
        Identity {
            own: Address::new(system.unwrap_or(Identity::FIRST), component),
            is_configured: system.is_some(),
            first_heard_at: None,
            heard: Vec::new(),
            settled: system.map(Settled::Configured),
            is_announced: false,
        }
    }

    /// Our address as it is now.
    pub const fn own(&self) -> Address {
        self.own
    }

    /// Whether the system id is decided.
    pub const fn is_settled(&self) -> bool {
        self.settled.is_some()
    }

    /// Whether `system` is the vehicle that we serve.
    pub fn serves(&self, system: u8) -> bool {
        self.own.system == system
            && matches!(self.settled, Some(Settled::Configured(_) | Settled::Adopted(_)))
    }

    /// Another vehicle's autopilot that is heard now, if the settings do not say which one is ours.
    pub fn rival(&self, now: Instant) -> Option<u8> {
        let is_other =
            |&&(system, at): &&(u8, Instant)| system != self.own.system && now.since(at) < Identity::GONE;
        let several = self.settled == Some(Settled::Several);
        let is_ours_open = !self.is_configured && self.is_settled();
        self.heard
            .iter()
            .find(is_other)
            .filter(|_| is_ours_open)
            .map(|&(system, _)| system)
            .or(several.then_some(self.own.system))
    }

    /// An autopilot's heartbeat arrived from `system`.
    pub fn hear(&mut self, now: Instant, system: u8) {
        if system == 0 {
            return;
        }
        self.first_heard_at.get_or_insert(now);
        match self.heard.iter_mut().find(|(heard, _)| *heard == system) {
            Some((_, at)) => *at = now,
            // A fifth one changes nothing: there are several already.
            None => {
                let _ = self.heard.push((system, now));
            }
        }
    }

    /// Decides when the window is over. Returns the decision once.
    pub fn poll(&mut self, now: Instant) -> Option<Settled> {
        if self.settled.is_none() {
            let first = self.first_heard_at?;
            if now.since(first) < Identity::WINDOW {
                return None;
            }
            self.settled = match self.heard.as_slice() {
                [(one, _)] => {
                    self.own.system = *one;
                    Some(Settled::Adopted(*one))
                }
                _ => Some(Settled::Several),
            };
        }
        let is_announced = core::mem::replace(&mut self.is_announced, true);
        self.settled.filter(|_| !is_announced)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(millis: u64) -> Instant {
        Instant::from_millis(millis)
    }

    #[test]
    fn the_only_autopilot_gives_its_system_id() {
        let mut identity = Identity::new(None, 191);
        assert_eq!(identity.poll(ms(60_000)), None, "nothing heard");
        identity.hear(ms(61_000), 42);
        identity.hear(ms(62_000), 42);
        assert_eq!(identity.poll(ms(63_999)), None);
        assert_eq!(identity.poll(ms(64_000)), Some(Settled::Adopted(42)));
        assert_eq!(identity.own(), Address::new(42, 191));
        assert_eq!(identity.poll(ms(65_000)), None, "announced once");
        identity.hear(ms(66_000), 7);
        assert_eq!(identity.own(), Address::new(42, 191));
        assert_eq!(identity.rival(ms(66_000)), Some(7));
        assert_eq!(identity.rival(ms(76_000)), None, "gone");
    }

    #[test]
    fn several_autopilots_are_not_chosen_from() {
        let mut identity = Identity::new(None, 191);
        for system in [1, 4, 5, 6, 7, 8] {
            identity.hear(Instant::ZERO, system);
        }
        assert_eq!(identity.poll(ms(3_000)), Some(Settled::Several));
        assert!((1..=8).all(|system| !identity.serves(system)));
        assert!(identity.rival(ms(100_000)).is_some(), "until a restart");
    }

    #[test]
    fn a_configured_id_pins() {
        let mut identity = Identity::new(Some(5), 191);
        assert_eq!(identity.poll(Instant::ZERO), Some(Settled::Configured(5)));
        for system in [42, 5, 7] {
            identity.hear(Instant::ZERO, system);
        }
        assert_eq!(identity.poll(ms(10_000)), None);
        assert_eq!(identity.own(), Address::new(5, 191));
        assert_eq!(identity.rival(ms(1_000)), None);
        assert_eq!([42, 5, 7].map(|system| identity.serves(system)), [false, true, false]);
    }
}
