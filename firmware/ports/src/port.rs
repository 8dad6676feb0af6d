//! A port of any kind, and waiting for several.

use crate::endpoint::{Endpoint, SocketName};
use crate::retry::Retry;
use crate::serial::Serial;
use crate::tcp::{TcpIn, TcpOut};
use crate::transport::{Down, Transport};
use crate::udp::{UdpIn, UdpOut};
use rustix::event::{PollFd, Timespec, poll};
use std::io;
use std::net::{SocketAddr, ToSocketAddrs};
use std::time::{Duration, Instant};

/// A port that could not be opened at the start: what, why, what to do.
#[derive(Debug, thiserror::Error)]
#[error("{endpoint}: {action}: {source}: {}", advice(.endpoint, .source))]
pub struct PortError {
    /// The endpoint asked for.
    pub endpoint: Endpoint,
    /// What failed.
    pub action: &'static str,
    /// Why.
    pub source: io::Error,
}

fn advice(endpoint: &Endpoint, error: &io::Error) -> &'static str {
    use io::ErrorKind::*;
    let serial = matches!(endpoint, Endpoint::Serial { .. });
    match error.kind() {
        NotFound if serial => "plug the device in, or look for its name in /dev/serial/by-id",
        PermissionDenied if serial => "add this user to the group that owns the device, often dialout",
        WouldBlock if serial => "another program has the device open, stop it",
        InvalidInput if serial => "the device does not know this baud rate, use another",
        _ if serial => "check that this is a serial device",
        PermissionDenied => "use a port number above 1023",
        AddrInUse => "stop the other program that uses this port, or choose another number",
        AddrNotAvailable => "use an address of this machine, or 0.0.0.0 for all of them",
        ConnectionRefused | TimedOut => "start the other side first, or correct host and port",
        _ => "correct host and port",
    }
}

/// Whether bytes can travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// They can.
    Up,
    /// They cannot, and why.
    Down(Down),
}

/// An open port.
pub struct Port {
    endpoint: Endpoint,
    transport: Box<dyn Transport>,
    /// Why it is down, meaningful while it is.
    reason: Down,
    /// What [`Port::maintain`] said last.
    told_up: bool,
    retry: Retry,
    dropped_frames: u64,
}

impl Port {
    /// Opens the port. The only call that may block, see the crate's page.
    ///
    /// # Errors
    /// The name is unknown, the address taken, the device missing, the peer not there: [`PortError`] says what
    /// to do.
    pub fn open(endpoint: &Endpoint) -> Result<Port, PortError> {
        let fail = |action| move |source| PortError { endpoint: endpoint.clone(), action, source };
        let resolve = |name: &SocketName| resolve(name).map_err(fail("cannot find the host"));
        let transport: Box<dyn Transport> = match endpoint {
            Endpoint::UdpIn(name) => Box::new(UdpIn::open(&resolve(name)?).map_err(fail("cannot listen"))?),
            Endpoint::UdpOut(name) => {
                Box::new(UdpOut::open(&resolve(name)?).map_err(fail("cannot send there"))?)
            }
            Endpoint::TcpIn(name) => Box::new(TcpIn::open(&resolve(name)?).map_err(fail("cannot listen"))?),
            Endpoint::TcpOut(name) => Box::new(TcpOut::open(resolve(name)?).map_err(fail("cannot connect"))?),
            Endpoint::Serial { path, baud } => {
                Box::new(Serial::open(path.clone(), *baud).map_err(fail("cannot open the device"))?)
            }
        };
        Ok(Port {
            endpoint: endpoint.clone(),
            told_up: transport.is_up(),
            transport,
            reason: Down::NoPeer,
            retry: Retry::new(),
            dropped_frames: 0,
        })
    }

    /// What was opened.
    #[must_use]
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// The bound address of a socket, with the number that the system chose for port 0.
    #[must_use]
    pub fn local_address(&self) -> Option<SocketAddr> {
        self.transport.local_address()
    }

    /// Whether bytes can travel now.
    #[must_use]
    pub fn state(&self) -> State {
        if self.transport.is_up() { State::Up } else { State::Down(self.reason) }
    }

    /// Frames that did not leave: the port was down, or the other side too slow.
    #[must_use]
    pub fn dropped_frames(&self) -> u64 {
        self.dropped_frames
    }

    /// Reads into `buffer`, at most one datagram; 0 means nothing now, for whatever reason. Call until it
    /// gives 0: only then may [`wait`] be trusted to wake for the next byte. [`crate::RECEIVE_BYTES`] is a good
    /// buffer.
    pub fn receive(&mut self, buffer: &mut [u8]) -> usize {
        let received = self.transport.receive(buffer);
        received.unwrap_or_else(|reason| {
            self.reason = reason;
            0
        })
    }

    /// Sends one whole frame, best effort: a frame that cannot leave now and has no room to wait is dropped and
    /// counted. A listening UDP port sends it to every peer heard; to nobody when nobody has spoken.
    pub fn send(&mut self, frame: &[u8]) {
        let sent = self.transport.send(frame).unwrap_or_else(|reason| {
            self.reason = reason;
            false
        });
        self.dropped_frames += u64::from(!sent);
    }

    /// Opens a lost port again when its time has come, and says once that it went down or came back. Call it
    /// some times a second.
    pub fn maintain(&mut self, now: Instant) -> Option<State> {
        if self.transport.is_up() {
            self.retry.reset();
        } else if self.retry.is_due(now)
            && let Err(reason) = self.transport.reopen()
        {
            self.reason = reason;
        }
        let up = self.transport.is_up();
        (up != std::mem::replace(&mut self.told_up, up)).then(|| self.state())
    }
}

fn resolve(name: &SocketName) -> io::Result<Vec<SocketAddr>> {
    let addresses: Vec<SocketAddr> = name.to_string().to_socket_addrs()?.collect();
    if addresses.is_empty() { Err(io::ErrorKind::NotFound.into()) } else { Ok(addresses) }
}

/// Sleeps until one of the ports has something to [`Port::receive`] or `timeout` has passed; says whether one
/// has. A signal ends the wait early. Nothing is consumed, and no processor time spent.
///
/// # Errors
/// The operating system cannot wait; treat it as fatal.
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
