//! UDP datagrams.

use crate::resolver::Resolver;
use crate::tcp::first;
use crate::transport::{Down, PEER_SILENCE, Transport};
use rustix::event::{PollFd, PollFlags};
use socket2::{Domain, Protocol, Socket, Type};
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::time::Instant;

/// Most peers of a listening UDP port. One more replaces the one that has been silent for the longest time.
pub const MAX_PEERS: usize = 8;

/// Which peers a listening UDP port serves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Peers {
    /// Every sender of a datagram is answered, up to [`MAX_PEERS`]. For simulators and tests.
    #[default]
    All,
    /// One peer: the first sender that [`crate::Port::confirm_peer`] was called for. Datagrams from other senders
    /// are refused until it has been silent for [`PEER_SILENCE`]. Nothing is sent before a peer is confirmed.
    Bound,
}

#[derive(Clone, Copy)]
struct Peer {
    address: SocketAddr,
    /// Whether it was confirmed since time passed last.
    heard: bool,
    heard_at: Option<Instant>,
}

/// Listens, and answers its peers.
pub(crate) struct UdpIn {
    socket: UdpSocket,
    rule: Peers,
    /// In the order in which they were heard, the last one last.
    peers: Vec<Peer>,
    /// Sender of the last datagram.
    sender: Option<SocketAddr>,
    refused: u64,
}

impl UdpIn {
    pub(crate) fn open(addresses: &[SocketAddr], rule: Peers) -> io::Result<UdpIn> {
        let socket = first(addresses, |address| {
            let socket = Socket::new(Domain::for_address(address), Type::DGRAM, Some(Protocol::UDP))?;
            if address.is_ipv6() {
                // [::] receives IPv4 as well, whatever the system's default is.
                socket.set_only_v6(false)?;
            }
            socket.set_nonblocking(true)?;
            socket.bind(&address.into())?;
            Ok(UdpSocket::from(socket))
        })?;
        Ok(UdpIn { socket, rule, peers: Vec::new(), sender: None, refused: 0 })
    }

    fn is_refused(&self, sender: SocketAddr) -> bool {
        let bound = self.rule == Peers::Bound && !self.peers.is_empty();
        bound && self.peers.iter().all(|peer| peer.address != sender)
    }

    fn add_peer(&mut self, address: SocketAddr) {
        let known = self.peers.iter().position(|peer| peer.address == address);
        let heard_at = known.and_then(|at| self.peers.remove(at).heard_at);
        let most = if self.rule == Peers::Bound { 1 } else { MAX_PEERS };
        if self.peers.len() >= most {
            self.peers.remove(0);
        }
        self.peers.push(Peer { address, heard: true, heard_at });
    }
}

impl Transport for UdpIn {
    fn is_up(&self) -> bool {
        true
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        while let Some((bytes, sender)) = next_datagram(|| self.socket.recv_from(buffer)) {
            if self.is_refused(sender) {
                self.refused = self.refused.saturating_add(1);
                continue;
            }
            self.sender = Some(sender);
            if self.rule == Peers::All {
                self.add_peer(sender);
            }
            if bytes > 0 {
                return Ok(bytes);
            }
        }
        Ok(0)
    }

    fn send(&mut self, frame: &[u8], _revocable: bool) -> Result<bool, Down> {
        let mut all = true;
        for peer in &self.peers {
            all &= self.socket.send_to(frame, peer.address).is_ok();
        }
        Ok(all)
    }

    fn reply(&mut self, frame: &[u8]) -> Result<bool, Down> {
        let sent = self.sender.map(|sender| self.socket.send_to(frame, sender));
        Ok(sent.is_some_and(|sent| sent.is_ok()))
    }

    fn confirm_peer(&mut self) {
        if let Some(sender) = self.sender {
            self.add_peer(sender);
        }
    }

    fn pass_time(&mut self, now: Instant) {
        if self.rule == Peers::All {
            return;
        }
        for peer in &mut self.peers {
            if std::mem::take(&mut peer.heard) || peer.heard_at.is_none() {
                peer.heard_at = Some(now);
            }
        }
        let is_alive = |at: Instant| now.saturating_duration_since(at) < PEER_SILENCE;
        self.peers.retain(|peer| peer.heard_at.is_some_and(is_alive));
    }

    fn refused(&self) -> u64 {
        self.refused
    }

    fn reopen(&mut self) -> Result<(), Down> {
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.socket.local_addr().ok()
    }

    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        watched.push(PollFd::new(&self.socket, PollFlags::IN));
    }
}

/// Sends first, to one peer, and receives from that one only; or broadcasts and receives from any peer.
pub(crate) struct UdpOut {
    resolver: Resolver,
    broadcast: bool,
    /// `None` until the host name has an address.
    open: Option<(UdpSocket, SocketAddr)>,
}

impl UdpOut {
    pub(crate) fn open(resolver: Resolver, broadcast: bool) -> io::Result<UdpOut> {
        let mut port = UdpOut { resolver, broadcast, open: None };
        if !port.resolver.addresses().is_empty() {
            port.open = Some(port.open_socket()?);
        }
        Ok(port)
    }

    fn open_socket(&self) -> io::Result<(UdpSocket, SocketAddr)> {
        first(self.resolver.addresses(), |address| {
            let socket = Socket::new(Domain::for_address(address), Type::DGRAM, Some(Protocol::UDP))?;
            socket.set_nonblocking(true)?;
            if self.broadcasts_to(address) {
                socket.set_broadcast(true)?;
                let any: SocketAddr = ([0, 0, 0, 0], 0).into();
                socket.bind(&any.into())?;
            } else {
                socket.connect(&address.into())?;
            }
            Ok((UdpSocket::from(socket), address))
        })
    }

    /// A connected socket would refuse the answers, which come from the addresses of single hosts.
    fn broadcasts_to(&self, address: SocketAddr) -> bool {
        let limited = matches!(address, SocketAddr::V4(address) if address.ip().is_broadcast());
        address.is_ipv4() && (self.broadcast || limited)
    }
}

impl Transport for UdpOut {
    fn is_up(&self) -> bool {
        self.open.is_some()
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        let Some((socket, _)) = &self.open else { return Ok(0) };
        while let Some((bytes, _)) = next_datagram(|| socket.recv_from(buffer)) {
            if bytes > 0 {
                return Ok(bytes);
            }
        }
        Ok(0)
    }

    fn send(&mut self, frame: &[u8], _revocable: bool) -> Result<bool, Down> {
        let Some((socket, address)) = &self.open else { return Ok(false) };
        if self.broadcasts_to(*address) {
            return Ok(socket.send_to(frame, address).is_ok());
        }
        // The first attempt may only report that an earlier datagram was refused.
        Ok(socket.send(frame).or_else(|_| socket.send(frame)).is_ok())
    }

    fn reopen(&mut self) -> Result<(), Down> {
        self.resolver.settle();
        if self.resolver.addresses().is_empty() {
            self.resolver.refresh();
            return Err(Down::Unresolved);
        }
        self.open = Some(self.open_socket()?);
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.open.as_ref().and_then(|(socket, _)| socket.local_addr().ok())
    }

    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        if let Some((socket, _)) = &self.open {
            watched.push(PollFd::new(socket, PollFlags::IN));
        }
    }
}

/// Calls `receive` until it returns a datagram or nothing is left. An error reports a datagram that was sent
/// earlier and refused: the peer may not have started yet, and the socket is still good.
fn next_datagram<T>(mut receive: impl FnMut() -> io::Result<T>) -> Option<T> {
    const ERRORS_IN_A_ROW: usize = 8;
    for _ in 0..ERRORS_IN_A_ROW {
        match receive() {
            Ok(datagram) => return Some(datagram),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return None,
            Err(_) => {}
        }
    }
    None
}
