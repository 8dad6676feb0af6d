//! Which ports a packet goes to.
//!
//! The rules are those of the MAVLink guide, "Routing": a packet goes to every other port unless it names a system
//! that was seen on some of them. Two ports that reach the same network form a loop; a packet that was seen a moment
//! ago is therefore not forwarded again.

use super::packets::{Address, Packet};
use std::collections::HashMap;
use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::{Duration, Instant};

/// A packet that returns within this time went around a loop. No sender repeats a packet within it: the sequence
/// number differs.
const LOOP_TIME: Duration = Duration::from_millis(500);
/// A system that has been silent for this long may be reached by another port.
const FORGET: Duration = Duration::from_secs(60);
/// Most packets remembered: more than arrive within [`LOOP_TIME`].
const REMEMBERED: usize = 4096;
/// `SETUP_SIGNING` carries the key and is never forwarded (MAVLink guide, "Message Signing").
const SETUP_SIGNING: u32 = 256;

/// The ports that a packet goes to, by number.
pub type Ports = Vec<usize>;

/// What was learnt of the network.
#[derive(Debug)]
pub struct Router {
    ports: usize,
    seen: HashMap<(Address, usize), Instant>,
    recent: VecDeque<(Instant, u64)>,
    loops: u64,
}

impl Router {
    /// A router between this number of ports.
    pub fn new(ports: usize) -> Router {
        Router { ports, seen: HashMap::new(), recent: VecDeque::new(), loops: 0 }
    }

    /// The ports for a packet that came from port `from`. `None`: the packet went around a loop; drop it.
    pub fn route(&mut self, now: Instant, from: usize, packet: &Packet) -> Option<Ports> {
        if self.is_loop(now, &packet.bytes) {
            self.loops += 1;
            return None;
        }
        if packet.verified {
            self.seen.insert((packet.sender, from), now);
        }
        if packet.message_id == SETUP_SIGNING {
            return Some(Ports::new());
        }
        Some(self.towards(now, packet.target).into_iter().filter(|&port| port != from).collect())
    }

    /// The ports for a packet of ours.
    pub fn route_own(&mut self, now: Instant, packet: &Packet) -> Ports {
        // Remembered, so that its return is noticed.
        self.is_loop(now, &packet.bytes);
        self.towards(now, packet.target)
    }

    /// Packets that went around a loop.
    pub fn loops(&self) -> u64 {
        self.loops
    }

    fn towards(&self, now: Instant, target: Option<Address>) -> Ports {
        let all = 0..self.ports;
        let Some((system, component)) = target else { return all.collect() };
        let is_known = |port: usize, wanted: &dyn Fn(Address) -> bool| {
            self.seen.iter().any(|(&(address, seen_on), &at)| {
                seen_on == port && wanted(address) && now.saturating_duration_since(at) < FORGET
            })
        };
        let exact: Ports =
            all.clone().filter(|&port| is_known(port, &|address| address == (system, component))).collect();
        if !exact.is_empty() {
            return exact;
        }
        // Every component of the system, or one that has not spoken yet.
        let same_system: Ports =
            all.clone().filter(|&port| is_known(port, &|(seen, _)| seen == system)).collect();
        if same_system.is_empty() { all.collect() } else { same_system }
    }

    fn is_loop(&mut self, now: Instant, bytes: &[u8]) -> bool {
        let mut hasher = DefaultHasher::new();
        bytes.hash(&mut hasher);
        let hash = hasher.finish();
        while self.recent.front().is_some_and(|&(at, _)| {
            now.saturating_duration_since(at) >= LOOP_TIME || self.recent.len() >= REMEMBERED
        }) {
            self.recent.pop_front();
        }
        if self.recent.iter().any(|&(_, seen)| seen == hash) {
            return true;
        }
        self.recent.push_back((now, hash));
        false
    }
}

#[cfg(test)]
mod tests {
    use super::super::packets::Packets;
    use super::super::packets::tests::{frame, heartbeat, unknown};
    use super::*;
    use mavlink::dialects::ardupilotmega::*;

    const AUTOPILOT: usize = 0;
    const GROUND: [usize; 2] = [1, 2];

    fn packet(bytes: &[u8]) -> Packet {
        let mut found = Vec::new();
        Packets::default().push(bytes, |packet| found.push(packet));
        found.remove(0)
    }

    fn command(target: Address, sender: Address, sequence: u8) -> Packet {
        let (target_system, target_component) = target;
        let command = COMMAND_LONG_DATA { target_system, target_component, ..COMMAND_LONG_DATA::DEFAULT };
        packet(&frame(&command, sender, sequence))
    }

    /// Autopilot 1 on port 0, ground station 255 on port 1, ground station 250 on port 2.
    fn network(now: Instant) -> Router {
        let mut router = Router::new(3);
        for (port, sender) in [(AUTOPILOT, (1, 1)), (GROUND[0], (255, 190)), (GROUND[1], (250, 190))] {
            let others: Ports = (0..3).filter(|&other| other != port).collect();
            assert_eq!(router.route(now, port, &packet(&heartbeat(sender, 0))), Some(others));
        }
        router
    }

    #[test]
    fn a_targeted_packet_goes_only_where_its_target_is() {
        let now = Instant::now();
        let mut router = network(now);
        assert_eq!(router.route(now, GROUND[0], &command((1, 1), (255, 190), 1)), Some(vec![AUTOPILOT]));
        assert_eq!(router.route(now, GROUND[0], &command((1, 0), (255, 190), 2)), Some(vec![AUTOPILOT]));
        assert_eq!(router.route(now, AUTOPILOT, &command((250, 190), (1, 1), 3)), Some(vec![GROUND[1]]));
        // A system that has not been seen may be anywhere.
        assert_eq!(router.route(now, AUTOPILOT, &command((9, 1), (1, 1), 4)), Some(GROUND.to_vec()));
        assert_eq!(router.route_own(now, &command((1, 1), (1, 191), 5)), [AUTOPILOT]);
        assert_eq!(router.route_own(now, &packet(&heartbeat((1, 191), 6))), [0, 1, 2]);
    }

    #[test]
    fn a_packet_that_returns_is_not_forwarded_again() {
        let start = Instant::now();
        let mut router = network(start);
        let beat = packet(&heartbeat((1, 1), 9));
        assert!(router.route(start, AUTOPILOT, &beat).is_some());
        assert_eq!(router.route(start + LOOP_TIME / 2, GROUND[0], &beat), None);
        let own = packet(&heartbeat((1, 191), 9));
        router.route_own(start + LOOP_TIME, &own);
        assert_eq!(router.route(start + LOOP_TIME, GROUND[1], &own), None);
        assert_eq!(router.loops(), 2);
        // Much later the sequence number has wrapped, and an equal packet is a new one.
        assert!(router.route(start + 10 * LOOP_TIME, AUTOPILOT, &beat).is_some());
    }

    #[test]
    fn keys_are_not_forwarded_and_unknown_messages_are() {
        let now = Instant::now();
        let mut router = network(now);
        let setup =
            SETUP_SIGNING_DATA { target_system: 1, target_component: 1, ..SETUP_SIGNING_DATA::DEFAULT };
        assert_eq!(router.route(now, GROUND[0], &packet(&frame(&setup, (255, 190), 1))), Some(vec![]));
        assert_eq!(router.route(now, AUTOPILOT, &packet(&unknown((1, 1)))), Some(GROUND.to_vec()));
    }
}
