//! The autopilot's MAVLink ports: framing, routing and streams.
//!
//! Routing follows ArduPilot's `MAVLink_routing`: messages without a target go to every port on which anything was
//! received; messages with one go to the ports on which the target was received.

use super::LinkId;
use super::streams::{Streams, Supported};
use crate::wire::{self, Speaker};
use gleaner_link::{Address, Frame, FrameDecoder};
use gleaner_units::Instant;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{COMMAND_ACK_DATA, MavResult, MavSeverity, STATUSTEXT_DATA};

#[derive(Debug)]
struct Port {
    decoder: FrameDecoder,
    speaker: Speaker,
    streams: Streams,
    out: Vec<Vec<u8>>,
}

/// The three ports of a simulated autopilot.
#[derive(Debug)]
pub(super) struct Ports {
    own: Address,
    ports: [Port; 3],
    /// Which address was received on which port.
    routes: Vec<(Address, LinkId)>,
}

impl Ports {
    /// Ports of the autopilot component of this system.
    pub fn new(system_id: u8, supported: Supported) -> Ports {
        let own = Address::new(system_id, 1);
        let port = || Port {
            decoder: FrameDecoder::new(),
            speaker: Speaker::new(own),
            streams: Streams::new(supported),
            out: Vec::new(),
        };
        Ports { own, ports: [port(), port(), port()], routes: Vec::new() }
    }

    /// The next frame in what is left of `bytes`.
    pub fn receive(&mut self, link: LinkId, bytes: &mut &[u8]) -> Option<Frame> {
        self.ports[link.0].decoder.read(bytes)
    }

    /// Passes a frame on. Whether it is (also) addressed to the autopilot.
    pub fn route(&mut self, from: LinkId, frame: &Frame) -> bool {
        if frame.sender == self.own {
            return false;
        }
        match self.routes.iter_mut().find(|(address, _)| *address == frame.sender) {
            Some((_, known)) => *known = from,
            None => self.routes.push((frame.sender, from)),
        }
        let target = wire::target(frame);
        for link in LinkId::ALL {
            let leads = self.routes.iter().any(|&(address, known)| known == link && target.reaches(address));
            if link != from && leads {
                self.ports[link.0].out.push(wire::relayed(frame));
            }
        }
        target.reaches(self.own)
    }

    /// The frames that left on a link since the last call.
    pub fn transmit(&mut self, link: LinkId) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.ports[link.0].out)
    }

    pub fn send<D: MessageData>(&mut self, link: LinkId, data: &D) {
        let port = &mut self.ports[link.0];
        port.out.push(port.speaker.frame(data));
    }

    /// `STATUSTEXT` on these links.
    pub fn say(&mut self, links: &[LinkId], severity: MavSeverity, text: &str) {
        let data = STATUSTEXT_DATA { severity, text: text.into(), ..STATUSTEXT_DATA::DEFAULT };
        for &link in links {
            self.send(link, &data);
        }
    }

    /// `COMMAND_ACK`, laid out by hand: the generated types cannot hold command numbers that they do not list.
    pub fn acknowledge(&mut self, link: LinkId, command: u16, result: MavResult, to: Address) {
        let [low, high] = command.to_le_bytes();
        let payload = [low, high, result as u8, 0, 0, 0, 0, 0, to.system, to.component];
        let port = &mut self.ports[link.0];
        port.out.push(port.speaker.raw_frame(COMMAND_ACK_DATA::ID, &payload));
    }

    pub fn streams(&mut self, link: LinkId) -> &mut Streams {
        &mut self.ports[link.0].streams
    }

    /// The next streamed message that is due on a link.
    pub fn due(&mut self, link: LinkId, now: Instant) -> Option<u32> {
        self.ports[link.0].streams.due(now)
    }
}
