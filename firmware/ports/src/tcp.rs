//! TCP connections.

use crate::outbox::Outbox;
use crate::resolver::Resolver;
use crate::transport::{Down, PEER_SILENCE, Transport};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use socket2::{Domain, Protocol, Socket, Type};
use std::io::{self, Read};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// How long [`crate::Port::open`] waits for a TCP peer to answer.
pub const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Connections that the system keeps for [`TcpIn`] until they are accepted.
const BACKLOG: i32 = 8;

/// An established connection and the bytes that it has not accepted yet.
struct Peer {
    stream: TcpStream,
    outbox: Outbox,
}

impl Peer {
    fn new(stream: TcpStream) -> io::Result<Peer> {
        stream.set_nonblocking(true)?;
        // Setpoints are small; they must not wait until a segment is full.
        stream.set_nodelay(true)?;
        Ok(Peer { stream, outbox: Outbox::default() })
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        self.outbox.flush(&mut self.stream)?;
        read_now(&mut self.stream, buffer)
    }

    fn send(&mut self, frame: &[u8], revocable: bool) -> Result<bool, Down> {
        Ok(self.outbox.send(frame, revocable, &mut self.stream)?)
    }

    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        let out = if self.outbox.is_empty() { PollFlags::empty() } else { PollFlags::OUT };
        watched.push(PollFd::new(&self.stream, PollFlags::IN | out));
    }
}

/// Reads what has arrived. The end of the stream means that the peer is gone.
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
    /// Whether the peer has sent bytes since time passed last.
    heard: bool,
    /// When the peer sent bytes last, as far as time has passed.
    heard_at: Option<Instant>,
    /// The peer has been silent for [`PEER_SILENCE`].
    silent: bool,
    refused: u64,
}

impl TcpIn {
    pub(crate) fn open(addresses: &[SocketAddr]) -> io::Result<TcpIn> {
        let listener = first(addresses, |address| {
            let socket = Socket::new(Domain::for_address(address), Type::STREAM, Some(Protocol::TCP))?;
            if address.is_ipv6() {
                // [::] listens on IPv4 as well, whatever the system's default is.
                socket.set_only_v6(false)?;
            }
            // Without this a restart finds the port in use until old connections have timed out.
            socket.set_reuse_address(true)?;
            socket.bind(&address.into())?;
            socket.listen(BACKLOG)?;
            socket.set_nonblocking(true)?;
            Ok(TcpListener::from(socket))
        })?;
        Ok(TcpIn { listener, peer: None, heard: false, heard_at: None, silent: false, refused: 0 })
    }

    /// A new connection does not replace one that is alive. A client that lost its connection without closing it
    /// gets in once the old one has been silent for [`PEER_SILENCE`].
    fn accept(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.peer.is_some() && !self.silent {
                self.refused = self.refused.saturating_add(1);
            } else if let Ok(peer) = Peer::new(stream) {
                (self.peer, self.heard, self.heard_at, self.silent) = (Some(peer), true, None, false);
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
        // The peer first: its end frees the place for a connection that waits.
        let received = self.with_peer(0, |peer| peer.receive(buffer));
        if received.is_ok_and(|bytes| bytes > 0) {
            (self.heard, self.silent) = (true, false);
        }
        self.accept();
        received
    }

    fn send(&mut self, frame: &[u8], revocable: bool) -> Result<bool, Down> {
        self.with_peer(false, |peer| peer.send(frame, revocable))
    }

    fn revoke(&mut self) -> usize {
        self.peer.as_mut().map_or(0, |peer| peer.outbox.revoke())
    }

    fn reopen(&mut self) -> Result<(), Down> {
        Ok(())
    }

    fn pass_time(&mut self, now: Instant) {
        if std::mem::take(&mut self.heard) {
            self.heard_at = Some(now);
        }
        let since = self.heard_at.map(|at| now.saturating_duration_since(at));
        self.silent = since.is_some_and(|since| since >= PEER_SILENCE);
    }

    fn refused(&self) -> u64 {
        self.refused
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

/// Tries the addresses in order; the error of the last one if none works.
pub(crate) fn first<T>(
    addresses: &[SocketAddr],
    mut open: impl FnMut(SocketAddr) -> io::Result<T>,
) -> io::Result<T> {
    let mut last = io::Error::from(io::ErrorKind::NotFound);
    for &address in addresses {
        match open(address) {
            Ok(opened) => return Ok(opened),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Connects, and connects again.
pub(crate) struct TcpOut {
    resolver: Resolver,
    /// Number of attempts so far; each takes the next address.
    attempts: usize,
    connection: Connection,
}

enum Connection {
    None,
    /// The handshake is under way.
    Pending(TcpStream),
    Established(Peer),
}

impl TcpOut {
    pub(crate) fn open(resolver: Resolver) -> io::Result<TcpOut> {
        let connect = |address| TcpStream::connect_timeout(&address, CONNECT_TIMEOUT).and_then(Peer::new);
        let connection = match resolver.addresses() {
            [] => Connection::None,
            addresses => Connection::Established(first(addresses, connect)?),
        };
        Ok(TcpOut { resolver, attempts: 0, connection })
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
    let socket = Socket::new(Domain::for_address(address), Type::STREAM, Some(Protocol::TCP))?;
    socket.set_nonblocking(true)?;
    let under_way = Some(rustix::io::Errno::INPROGRESS.raw_os_error());
    if let Err(error) = socket.connect(&address.into())
        && error.raw_os_error() != under_way
    {
        return Err(error);
    }
    // An error that is known already, such as a refusal on loopback.
    match socket.take_error()? {
        Some(error) => Err(error),
        None => Ok(TcpStream::from(socket)),
    }
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

    fn send(&mut self, frame: &[u8], revocable: bool) -> Result<bool, Down> {
        let Connection::Established(peer) = &mut self.connection else { return Ok(false) };
        peer.send(frame, revocable).inspect_err(|_| self.connection = Connection::None)
    }

    fn revoke(&mut self) -> usize {
        match &mut self.connection {
            Connection::Established(peer) => peer.outbox.revoke(),
            Connection::None | Connection::Pending(_) => 0,
        }
    }

    /// Connects to the next known address, and looks the name up for the attempt after this one: the host may have
    /// another address by then.
    fn reopen(&mut self) -> Result<(), Down> {
        self.resolver.settle();
        self.resolver.refresh();
        self.connection = Connection::None;
        let addresses = self.resolver.addresses();
        let Some(&address) = addresses.get(self.attempts % addresses.len().max(1)) else {
            return Err(Down::Unresolved);
        };
        self.attempts += 1;
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
