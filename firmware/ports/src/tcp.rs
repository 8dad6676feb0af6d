//! Connections.

use crate::outbox::Outbox;
use crate::transport::{Down, Transport};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::{AddressFamily, SocketFlags, SocketType, connect, ipproto, socket_with, sockopt};
use std::io::{self, Read};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

/// How long [`crate::Port::open`] waits for a TCP peer to answer.
pub const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// An established connection and what it did not take yet.
struct Peer {
    stream: TcpStream,
    outbox: Outbox,
}

impl Peer {
    fn new(stream: TcpStream) -> io::Result<Peer> {
        stream.set_nonblocking(true)?;
        // Setpoints are small and must not wait for company.
        stream.set_nodelay(true)?;
        Ok(Peer { stream, outbox: Outbox::default() })
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        self.outbox.flush(&mut self.stream)?;
        read_now(&mut self.stream, buffer)
    }

    fn send(&mut self, frame: &[u8]) -> Result<bool, Down> {
        Ok(self.outbox.send(frame, &mut self.stream)?)
    }

    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        let out = if self.outbox.is_empty() { PollFlags::empty() } else { PollFlags::OUT };
        watched.push(PollFd::new(&self.stream, PollFlags::IN | out));
    }
}

/// Reads what is there; the end of the stream is a peer that is gone.
pub(crate) fn read_now(stream: &mut impl Read, buffer: &mut [u8]) -> Result<usize, Down> {
    if buffer.is_empty() {
        return Ok(0);
    }
    loop {
        match stream.read(buffer) {
            Ok(0) => return Err(Down::Gone),
            Ok(bytes) => return Ok(bytes),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(0),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
}

/// Listens; one peer at a time.
pub(crate) struct TcpIn {
    listener: TcpListener,
    peer: Option<Peer>,
}

impl TcpIn {
    pub(crate) fn open(addresses: &[SocketAddr]) -> io::Result<TcpIn> {
        let listener = TcpListener::bind(addresses)?;
        listener.set_nonblocking(true)?;
        Ok(TcpIn { listener, peer: None })
    }

    /// The newest connection wins: a client that was restarted must not wait for its own ghost.
    fn accept(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            if let Ok(peer) = Peer::new(stream) {
                self.peer = Some(peer);
            }
        }
    }

    fn with_peer<T>(&mut self, idle: T, act: impl FnOnce(&mut Peer) -> Result<T, Down>) -> Result<T, Down> {
        let Some(peer) = &mut self.peer else { return Ok(idle) };
        act(peer).inspect_err(|_| self.peer = None)
    }
}

impl Transport for TcpIn {
    fn is_up(&self) -> bool {
        self.peer.is_some()
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        self.accept();
        self.with_peer(0, |peer| peer.receive(buffer))
    }

    fn send(&mut self, frame: &[u8]) -> Result<bool, Down> {
        self.with_peer(false, |peer| peer.send(frame))
    }

    fn reopen(&mut self) -> Result<(), Down> {
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.listener.local_addr().ok()
    }

    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        watched.push(PollFd::new(&self.listener, PollFlags::IN));
        if let Some(peer) = &self.peer {
            peer.watch(watched);
        }
    }
}

/// Connects, and again.
pub(crate) struct TcpOut {
    addresses: Vec<SocketAddr>,
    /// Which address the next attempt takes.
    attempt: usize,
    connection: Connection,
}

enum Connection {
    None,
    /// The handshake is under way.
    Pending(TcpStream),
    Established(Peer),
}

impl TcpOut {
    pub(crate) fn open(addresses: Vec<SocketAddr>) -> io::Result<TcpOut> {
        let mut last = io::Error::from(io::ErrorKind::NotFound);
        for address in &addresses {
            match TcpStream::connect_timeout(address, CONNECT_TIMEOUT).and_then(Peer::new) {
                Ok(peer) => {
                    return Ok(TcpOut { addresses, attempt: 0, connection: Connection::Established(peer) });
                }
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    fn settle(&mut self) -> Result<(), Down> {
        let Connection::Pending(stream) = &self.connection else { return Ok(()) };
        let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
        let ready = poll(&mut [PollFd::new(stream, PollFlags::OUT)], Some(&at_once)).unwrap_or(0);
        if ready == 0 {
            return Ok(());
        }
        let Connection::Pending(stream) = std::mem::replace(&mut self.connection, Connection::None) else {
            return Ok(());
        };
        if let Some(error) = stream.take_error()? {
            return Err(error.into());
        }
        self.connection = Connection::Established(Peer::new(stream)?);
        Ok(())
    }
}

/// Starts a handshake without waiting for it.
fn begin_connect(address: SocketAddr) -> io::Result<TcpStream> {
    let family = if address.is_ipv4() { AddressFamily::INET } else { AddressFamily::INET6 };
    let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
    let socket = socket_with(family, SocketType::STREAM, flags, Some(ipproto::TCP))?;
    match connect(&socket, &address) {
        Ok(()) | Err(rustix::io::Errno::INPROGRESS) => {}
        Err(error) => return Err(error.into()),
    }
    // Reads and clears an error that is already known, such as a refusal on loopback.
    sockopt::socket_error(&socket)??;
    Ok(TcpStream::from(socket))
}

impl Transport for TcpOut {
    fn is_up(&self) -> bool {
        matches!(self.connection, Connection::Established(_))
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        self.settle()?;
        let Connection::Established(peer) = &mut self.connection else { return Ok(0) };
        peer.receive(buffer).inspect_err(|_| self.connection = Connection::None)
    }

    fn send(&mut self, frame: &[u8]) -> Result<bool, Down> {
        let Connection::Established(peer) = &mut self.connection else { return Ok(false) };
        peer.send(frame).inspect_err(|_| self.connection = Connection::None)
    }

    fn reopen(&mut self) -> Result<(), Down> {
        let Some(&address) = self.addresses.get(self.attempt % self.addresses.len().max(1)) else {
            return Ok(());
        };
        self.attempt += 1;
        self.connection = Connection::None;
        self.connection = Connection::Pending(begin_connect(address)?);
        self.settle()
    }

    fn local_address(&self) -> Option<SocketAddr> {
        match &self.connection {
            Connection::None => None,
            Connection::Pending(stream) | Connection::Established(Peer { stream, .. }) => {
                stream.local_addr().ok()
            }
        }
    }

    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        match &self.connection {
            Connection::None => {}
            Connection::Pending(stream) => watched.push(PollFd::new(stream, PollFlags::OUT)),
            Connection::Established(peer) => peer.watch(watched),
        }
    }
}
