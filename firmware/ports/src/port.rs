//! A port of any kind, and waiting for several.

use crate::endpoint::Endpoint;
use crate::port_error::PortError;
use crate::resolver::{Resolver, resolve};
use crate::retry::Retry;
use crate::serial::Serial;
use crate::tcp::{TcpIn, TcpOut};
use crate::transport::{Down, Transport};
use crate::udp::{Peers, UdpIn, UdpOut};
use rustix::event::{PollFd, Timespec, poll};
use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// Whether a port can move bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It can.
    Up,
    /// It cannot, and why.
    Down(Down),
}

/// Traffic of a port since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortStats {
    /// Bytes received.
    pub bytes_in: u64,
    /// Bytes of the frames that were handed to the system or queued.
    pub bytes_out: u64,
    /// Frames that were handed to the system or queued.
    pub frames_out: u64,
    /// Frames that were dropped: the port was down, or its peer too slow.
    pub frames_dropped: u64,
    /// Datagrams and connections refused because another peer holds the port.
    pub refused: u64,
}

/// An open port.
pub struct Port {
    endpoint: Endpoint,
    transport: Box<dyn Transport>,
    /// Why it is down; meaningful only while it is.
    reason: Down,
    /// The state that [`Port::maintain`] reported last.
    reported_up: bool,
    retry: Retry,
    stats: PortStats,
}

impl Port {
    /// Opens the port. A listening UDP port answers all senders, see [`Peers::All`]. The only call that may block,
    /// see the crate's page.
    ///
    /// # Errors
    /// The address is taken, the device missing, the peer not there. [`PortError`] says what to do. The name of a
    /// host to connect or send to may be unknown: then the port is down until it gets an address.
    pub fn open(endpoint: &Endpoint) -> Result<Port, PortError> {
        Port::open_for(endpoint, Peers::All)
    }

    /// Like [`Port::open`], with a rule for the peers of a listening UDP port. Other kinds ignore the rule.
    ///
    /// # Errors
    /// As [`Port::open`].
    pub fn open_for(endpoint: &Endpoint, peers: Peers) -> Result<Port, PortError> {
        let fail = |action| move |source| PortError { endpoint: endpoint.clone(), action, source };
        let resolve = |name| resolve(name).map_err(fail("cannot find the host"));
        let transport: Box<dyn Transport> = match endpoint {
            Endpoint::UdpIn(name) => {
                Box::new(UdpIn::open(&resolve(name)?, peers).map_err(fail("cannot listen"))?)
            }
            Endpoint::UdpOut(name) | Endpoint::UdpBroadcast(name) => {
                let broadcast = matches!(endpoint, Endpoint::UdpBroadcast(_));
                let resolver = Resolver::new(name.clone());
                Box::new(UdpOut::open(resolver, broadcast).map_err(fail("cannot send there"))?)
            }
            Endpoint::TcpIn(name) => Box::new(TcpIn::open(&resolve(name)?).map_err(fail("cannot listen"))?),
            Endpoint::TcpOut(name) => {
                Box::new(TcpOut::open(Resolver::new(name.clone())).map_err(fail("cannot connect"))?)
            }
            Endpoint::Serial { path, baud } => {
                Box::new(Serial::open(path.clone(), *baud).map_err(fail("cannot open the device"))?)
            }
        };
        let listens = matches!(endpoint, Endpoint::TcpIn(_));
        Ok(Port {
            endpoint: endpoint.clone(),
            reported_up: transport.is_up(),
            transport,
            reason: if listens { Down::NoPeer } else { Down::Unresolved },
            retry: Retry::new(),
            stats: PortStats::default(),
        })
    }

    /// The endpoint that was opened.
    #[must_use]
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// The bound address of a socket, with the number that the system chose for port 0.
    #[must_use]
    pub fn local_address(&self) -> Option<SocketAddr> {
        self.transport.local_address()
    }

    /// Whether the port can move bytes now.
    #[must_use]
    pub fn state(&self) -> State {
        if self.transport.is_up() { State::Up } else { State::Down(self.reason) }
    }

    /// The traffic so far.
    #[must_use]
    pub fn stats(&self) -> PortStats {
        PortStats { refused: self.transport.refused(), ..self.stats }
    }

    /// Reads into `buffer`, at most one datagram. 0 means that nothing has arrived, or that the port is down. Call
    /// until it returns 0: only then does [`wait`] wake for the next byte. [`crate::RECEIVE_BYTES`] is a good
    /// size.
    pub fn receive(&mut self, buffer: &mut [u8]) -> usize {
        let received = self.transport.receive(buffer);
        let bytes = received.unwrap_or_else(|reason| {
            self.reason = reason;
            0
        });
        self.stats.bytes_in = self.stats.bytes_in.saturating_add(bytes as u64);
        bytes
    }

    /// Accepts the sender of the last datagram as the peer of a port opened with [`Peers::Bound`], or notes that
    /// the peer is still there. The caller has found a valid frame of an allowed sender in the datagram.
    pub fn confirm_peer(&mut self) {
        self.transport.confirm_peer();
    }

    /// Sends one whole frame, best effort: a frame that cannot leave now and finds no room in the queue is dropped
    /// and counted. A listening UDP port sends it to every peer, and to no one while it has none.
    pub fn send(&mut self, frame: &[u8]) {
        let sent = self.transport.send(frame, false);
        self.count(frame, sent);
    }

    /// Like [`Port::send`], for a frame that [`Port::revoke`] takes back as long as it waits in the queue.
    pub fn send_revocable(&mut self, frame: &[u8]) {
        let sent = self.transport.send(frame, true);
        self.count(frame, sent);
    }

    /// Sends one frame to the sender of the last datagram, whether or not it is a peer: the acknowledgement of a
    /// protocol with answers. On other ports the same as [`Port::send`].
    pub fn reply(&mut self, frame: &[u8]) {
        let sent = self.transport.reply(frame);
        self.count(frame, sent);
    }

    fn count(&mut self, frame: &[u8], sent: Result<bool, Down>) {
        let sent = sent.unwrap_or_else(|reason| {
            self.reason = reason;
            false
        });
        if sent {
            self.stats.frames_out = self.stats.frames_out.saturating_add(1);
            self.stats.bytes_out = self.stats.bytes_out.saturating_add(frame.len() as u64);
        } else {
            self.stats.frames_dropped = self.stats.frames_dropped.saturating_add(1);
        }
    }

    /// Drops all queued frames that were sent with [`Port::send_revocable`]; returns how many. On a serial port
    /// the untransmitted bytes in the kernel are dropped as well.
    pub fn revoke(&mut self) -> usize {
        self.transport.revoke()
    }

    /// Opens a lost port again when its time has come, and reports once that it went down or came back. Call it
    /// some times a second.
    pub fn maintain(&mut self, now: Instant) -> Option<State> {
        self.transport.pass_time(now);
        if self.transport.is_up() {
            self.retry.reset();
        } else if self.retry.is_due(now)
            && let Err(reason) = self.transport.reopen()
        {
            self.reason = reason;
        }
        let up = self.transport.is_up();
        (up != std::mem::replace(&mut self.reported_up, up)).then(|| self.state())
    }
}

/// Sleeps until one of the ports has something to [`Port::receive`] or `timeout` has passed; returns whether one
/// has. A signal ends the wait early. The call reads nothing.
///
/// # Errors
/// The operating system cannot wait.
pub fn wait(ports: &[&Port], timeout: Duration) -> io::Result<bool> {
    let mut watched: Vec<PollFd<'_>> = Vec::with_capacity(2 * ports.len());
    for port in ports {
        port.transport.watch(&mut watched);
    }
    let timeout = Timespec::try_from(timeout).map_err(io::Error::other)?;
    match poll(&mut watched, Some(&timeout)) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}
