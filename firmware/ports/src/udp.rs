//! Datagrams.

use crate::transport::{Down, Transport};
use rustix::event::{PollFd, PollFlags};
use std::io;
use std::net::{SocketAddr, UdpSocket};

/// Peers that a listening UDP port answers; one more replaces the one not heard for longest.
pub const MAX_PEERS: usize = 8;

/// Answers everybody who has spoken.
pub(crate) struct UdpIn {
    socket: UdpSocket,
    /// The last heard comes last.
    peers: Vec<SocketAddr>,
}

impl UdpIn {
    pub(crate) fn open(addresses: &[SocketAddr]) -> io::Result<UdpIn> {
        let socket = UdpSocket::bind(addresses)?;
        socket.set_nonblocking(true)?;
        Ok(UdpIn { socket, peers: Vec::new() })
    }

    fn heard(&mut self, peer: SocketAddr) {
        if self.peers.last() == Some(&peer) {
            return;
        }
        self.peers.retain(|known| *known != peer);
        if self.peers.len() == MAX_PEERS {
            self.peers.remove(0);
        }
        self.peers.push(peer);
    }
}

impl Transport for UdpIn {
    fn is_up(&self) -> bool {
        true
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        while let Some((bytes, peer)) = next_datagram(|| self.socket.recv_from(buffer)) {
            self.heard(peer);
            if bytes > 0 {
                return Ok(bytes);
            }
        }
        Ok(0)
    }

    fn send(&mut self, frame: &[u8]) -> Result<bool, Down> {
        let mut all = true;
        for peer in &self.peers {
            all &= self.socket.send_to(frame, peer).is_ok();
        }
        Ok(all)
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

/// Speaks first, to one peer, and hears only that one.
pub(crate) struct UdpOut {
    socket: UdpSocket,
}

impl UdpOut {
    pub(crate) fn open(addresses: &[SocketAddr]) -> io::Result<UdpOut> {
        let mut last = io::Error::from(io::ErrorKind::NotFound);
        for address in addresses {
            let any: SocketAddr = match address {
                SocketAddr::V4(_) => ([0, 0, 0, 0], 0).into(),
                SocketAddr::V6(_) => ([0u16; 8], 0).into(),
            };
            let opened = UdpSocket::bind(any).and_then(|socket| {
                socket.connect(address)?;
                socket.set_nonblocking(true)?;
                Ok(socket)
            });
            match opened {
                Ok(socket) => return Ok(UdpOut { socket }),
                Err(error) => last = error,
            }
        }
        Err(last)
    }
}

impl Transport for UdpOut {
    fn is_up(&self) -> bool {
        true
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        while let Some(bytes) = next_datagram(|| self.socket.recv(buffer)) {
            if bytes > 0 {
                return Ok(bytes);
            }
        }
        Ok(0)
    }

    fn send(&mut self, frame: &[u8]) -> Result<bool, Down> {
        // The first attempt may only fetch the news that an earlier datagram was refused.
        Ok(self.socket.send(frame).or_else(|_| self.socket.send(frame)).is_ok())
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

/// Calls `receive` until it gives a datagram or nothing is left. A refusal is news about something sent
/// earlier: the peer may not have started yet, and nothing is wrong with this socket.
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
