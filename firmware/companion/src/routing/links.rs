//! The MAVLink ports of a run: the autopilot's, and any number for ground stations.

use super::packets::{Packet, Packets};
use super::router::Router;
use super::signing::SignedPort;
use gleaner_ports::{Endpoint, Port, PortStats, RECEIVE_BYTES, State};
use std::time::Instant;

/// Messages of ours that move the aircraft or change its mode. Only these are taken back by a revocation; a status
/// text still leaves.
const MOVING: [u32; 5] = [
    11, // SET_MODE
    75, // COMMAND_INT
    76, // COMMAND_LONG
    84, // SET_POSITION_TARGET_LOCAL_NED
    86, // SET_POSITION_TARGET_GLOBAL_INT
];

/// A port with the packets that arrive on it.
struct Link {
    role: &'static str,
    port: Port,
    packets: Packets,
    datagrams: bool,
    /// Signs and verifies, on a port that needs it.
    signed: Option<SignedPort>,
}

/// All MAVLink ports, with the routing between them. Port 0 is the autopilot's.
pub struct Links {
    links: Vec<Link>,
    router: Router,
    /// Finds the packets in what this program sends.
    sent: Packets,
}

impl Links {
    /// Connects the ports: the autopilot's first. A port with a [`SignedPort`] sends and accepts signed packets only.
    pub fn new(ports: Vec<(&'static str, Port, Option<SignedPort>)>) -> Links {
        let router = Router::new(ports.len());
        let links = ports
            .into_iter()
            .map(|(role, port, signed)| Link {
                role,
                signed,
                datagrams: is_datagrams(port.endpoint()),
                port,
                packets: Packets::default(),
            })
            .collect();
        Links { links, router, sent: Packets::default() }
    }

    /// Reads each port at most `reads` times, forwards between the ports, and hands each new packet to `deliver`, with the
    /// number of its port.
    /// Returns whether bytes may be left.
    pub fn receive(&mut self, now: Instant, reads: usize, mut deliver: impl FnMut(usize, &Packet)) -> bool {
        let mut more = false;
        let mut buffer = [0; RECEIVE_BYTES];
        for from in 0..self.links.len() {
            for read in 1..=reads {
                let found = self.links[from].read(&mut buffer);
                let Some(found) = found else { break };
                more |= read == reads;
                for packet in found {
                    let Some(ports) = self.router.route(now, from, &packet) else { continue };
                    for to in ports {
                        self.links[to].send(&packet.bytes, false);
                    }
                    if packet.verified {
                        deliver(from, &packet);
                    }
                }
            }
        }
        more
    }

    /// Sends a packet of ours to the ports where it belongs. `sent` sees it.
    pub fn send(&mut self, now: Instant, bytes: &[u8], mut sent: impl FnMut(&Packet)) {
        let mut packets = Vec::new();
        self.sent.push(bytes, |packet| packets.push(packet));
        self.sent.end_datagram();
        for packet in packets {
            let moving = MOVING.contains(&packet.message_id);
            for to in self.router.route_own(now, &packet) {
                self.links[to].send(&packet.bytes, moving);
            }
            sent(&packet);
        }
    }

    /// Takes back every queued packet of ours that moves the aircraft; returns how many.
    pub fn revoke(&mut self) -> usize {
        self.links.iter_mut().map(|link| link.port.revoke()).sum()
    }

    /// Maintains the ports; reports each that went down or came back.
    pub fn maintain(&mut self, now: Instant, mut report: impl FnMut(&'static str, &Port, State)) {
        for link in &mut self.links {
            if let Some(signed) = &mut link.signed {
                signed.pass_time(now);
            }
            if let Some(state) = link.port.maintain(now) {
                report(link.role, &link.port, state);
            }
        }
    }

    /// The ports, for waiting and for introductions.
    pub fn ports(&self) -> impl Iterator<Item = (&'static str, &Port)> {
        self.links.iter().map(|link| (link.role, &link.port))
    }

    /// One line of counters for each port.
    pub fn summary(&self) -> impl Iterator<Item = String> {
        self.links.iter().map(describe)
    }

    /// Stores what must outlive the run.
    pub fn close(self) {
        for signed in self.links.into_iter().filter_map(|link| link.signed) {
            signed.close();
        }
    }

    /// Packets dropped because they went around a loop.
    pub fn loops(&self) -> u64 {
        self.router.loops()
    }
}

impl Link {
    /// The packets of one read; `None` when nothing has arrived.
    fn read(&mut self, buffer: &mut [u8]) -> Option<Vec<Packet>> {
        let bytes = self.port.receive(buffer);
        let bytes = buffer.get(..bytes).filter(|bytes| !bytes.is_empty())?;
        let mut found = Vec::new();
        self.packets.push(bytes, |packet| found.push(packet));
        if self.datagrams {
            self.packets.end_datagram();
        }
        if let Some(signed) = &mut self.signed {
            found.retain(|packet| signed.check(packet));
        }
        // Any valid packet makes its sender the peer of a bound port; who may command is decided by the pilot's link.
        if found.iter().any(|packet| packet.verified) {
            self.port.confirm_peer();
        }
        Some(found)
    }

    fn send(&mut self, packet: &[u8], revocable: bool) {
        let signed = match &mut self.signed {
            Some(signed) => signed.sign(packet),
            None => Some(packet.to_vec()),
        };
        match signed {
            Some(packet) if revocable => self.port.send_revocable(&packet),
            Some(packet) => self.port.send(&packet),
            // MAVLink 1 has no signatures.
            None => {}
        }
    }
}

fn is_datagrams(endpoint: &Endpoint) -> bool {
    matches!(endpoint, Endpoint::UdpIn(_) | Endpoint::UdpOut(_) | Endpoint::UdpBroadcast(_))
}

fn describe(link: &Link) -> String {
    let Link { role, port, packets, signed, .. } = link;
    let packets = packets.stats();
    let signing = signed.as_ref().map(SignedPort::stats).unwrap_or_default();
    let PortStats { bytes_in, bytes_out, frames_out, frames_dropped, refused } = port.stats();
    let mut line = format!(
        "{role} port {}: {} packets in ({bytes_in} bytes), {frames_out} out ({bytes_out} bytes)",
        port.endpoint(),
        packets.packets
    );
    for (count, what) in [
        (packets.damaged, "damaged"),
        (packets.garbage_bytes, "bytes of no packet"),
        (frames_dropped, "not sent"),
        (refused, "refused from other senders"),
        (u64::from(signing.unsigned), "unsigned"),
        (u64::from(signing.wrong), "wrongly signed"),
        (u64::from(signing.replayed) + u64::from(signing.old), "replayed or old"),
    ] {
        if count > 0 {
            line += &format!(", {count} {what}");
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::super::packets::tests::{frame, heartbeat};
    use super::*;
    use gleaner_link::SigningKey;
    use gleaner_ports::{Peers, wait};
    use mavlink::dialects::ardupilotmega::*;
    use std::net::UdpSocket;
    use std::time::Duration;

    const DEADLINE: Duration = Duration::from_secs(20);

    fn open() -> Port {
        Port::open_for(&"udpin:127.0.0.1:0".parse().unwrap(), Peers::Bound).unwrap()
    }

    fn peer(port: &Port) -> UdpSocket {
        let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
        peer.connect(port.local_address().unwrap()).unwrap();
        peer.set_read_timeout(Some(DEADLINE)).unwrap();
        peer
    }

    fn received(peer: &UdpSocket) -> Vec<u8> {
        let mut buffer = [0; 512];
        let bytes = peer.recv(&mut buffer).unwrap();
        buffer[..bytes].to_vec()
    }

    /// Receives until a packet has been delivered.
    fn deliver(links: &mut Links) -> (usize, (u8, u8)) {
        let mut delivered = None;
        while delivered.is_none() {
            let ports: Vec<&Port> = links.ports().map(|(_, port)| port).collect();
            assert!(wait(&ports, DEADLINE).unwrap(), "nothing arrived");
            links.receive(Instant::now(), 1, |port, packet| {
                delivered = Some((port, packet.sender));
            });
        }
        delivered.unwrap()
    }

    #[test]
    fn ground_station_and_autopilot_reach_each_other_and_the_pilot() {
        let (autopilot_port, ground_port) = (open(), open());
        let (autopilot, ground) = (peer(&autopilot_port), peer(&ground_port));
        let mut links = Links::new(vec![("autopilot", autopilot_port, None), ("ground", ground_port, None)]);
        ground.send(b"no packet at all").unwrap();
        ground.send(&heartbeat((255, 190), 0)).unwrap();
        assert_eq!(deliver(&mut links), (1, (255, 190)));
        let beat = heartbeat((1, 1), 0);
        autopilot.send(&beat).unwrap();
        assert_eq!(deliver(&mut links), (0, (1, 1)));
        assert_eq!(received(&ground), beat, "forwarded unchanged");

        let command =
            COMMAND_LONG_DATA { target_system: 1, target_component: 1, ..COMMAND_LONG_DATA::DEFAULT };
        let command = frame(&command, (255, 190), 1);
        ground.send(&command).unwrap();
        assert_eq!(deliver(&mut links), (1, (255, 190)));
        assert_eq!(received(&autopilot), command);

        let mut texts = 0;
        links.send(Instant::now(), &heartbeat((1, 191), 0), |_| texts += 1);
        assert_eq!((received(&autopilot), texts), (received(&ground), 1));
        let summary: Vec<String> = links.summary().collect();
        assert!(summary[1].contains("2 packets in"), "{summary:?}");
        assert!(summary[1].contains("16 bytes of no packet"), "{summary:?}");
    }

    #[test]
    fn a_signed_port_accepts_and_sends_signed_packets_only() {
        let key = || SigningKey::from_passphrase("a passphrase");
        let (autopilot_port, ground_port) = (open(), open());
        let (autopilot, ground) = (peer(&autopilot_port), peer(&ground_port));
        let signed = SignedPort::open(key(), 1, None).ok();
        let mut links =
            Links::new(vec![("autopilot", autopilot_port, None), ("ground", ground_port, signed)]);
        let mut station = SignedPort::open(key(), 9, None).ok().unwrap();
        ground.send(&heartbeat((255, 190), 0)).unwrap();
        ground.send(&station.sign(&heartbeat((255, 190), 1)).unwrap()).unwrap();
        assert_eq!(deliver(&mut links), (1, (255, 190)));
        let beat = heartbeat((1, 1), 0);
        autopilot.send(&beat).unwrap();
        assert_eq!(deliver(&mut links), (0, (1, 1)));
        let forwarded = received(&ground);
        assert_eq!(forwarded.len(), beat.len() + 13, "forwarded with a signature");
        let mut found = Vec::new();
        Packets::default().push(&forwarded, |packet| found.push(packet));
        assert!(station.check(&found[0]));
        let summary: Vec<String> = links.summary().collect();
        assert!(summary[1].contains(", 1 unsigned"), "{summary:?}");
    }
}
