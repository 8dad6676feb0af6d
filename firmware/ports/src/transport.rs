//! The interface of every kind of port.

use rustix::event::PollFd;
use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// After this much silence a peer counts as gone: its place is free for another.
pub const PEER_SILENCE: Duration = Duration::from_secs(10);

/// Why a port is down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Down {
    /// A listening TCP port without a connection.
    #[error("no peer has connected yet")]
    NoPeer,
    /// The host name has no address yet, for example because the network is not up.
    #[error("the host name has no address yet")]
    Unresolved,
    /// The peer closed the connection, or the device was unplugged.
    #[error("the other side is gone")]
    Gone,
    /// An error of the operating system.
    #[error("{0}")]
    Failed(io::ErrorKind),
}

impl From<io::Error> for Down {
    fn from(error: io::Error) -> Down {
        match error.kind() {
            // A terminal returns EIO, which has no kind, after its device was unplugged.
            _ if error.raw_os_error() == Some(rustix::io::Errno::IO.raw_os_error()) => Down::Gone,
            io::ErrorKind::BrokenPipe | io::ErrorKind::ConnectionReset => Down::Gone,
            kind => Down::Failed(kind),
        }
    }
}

/// One kind of port. No method may block. After an `Err` the transport must not be up.
pub(crate) trait Transport {
    /// Whether bytes can move now.
    fn is_up(&self) -> bool;

    /// Reads what has arrived; 0 when nothing has. Also continues what is pending: connections to accept or to
    /// complete, bytes to send.
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down>;

    /// Sends one frame; `false` when it was dropped. A revocable frame can be taken back while it is queued.
    fn send(&mut self, frame: &[u8], revocable: bool) -> Result<bool, Down>;

    /// Sends one frame to the sender of the last datagram only.
    fn reply(&mut self, frame: &[u8]) -> Result<bool, Down> {
        self.send(frame, false)
    }

    /// Drops revocable frames that have not left; returns how many.
    fn revoke(&mut self) -> usize {
        0
    }

    /// Starts to open the port again. Called only while it is not up.
    fn reopen(&mut self) -> Result<(), Down>;

    /// Called some times a second, for whatever expires.
    fn pass_time(&mut self, _now: Instant) {}

    /// The sender of the last datagram is a valid peer.
    fn confirm_peer(&mut self) {}

    /// Datagrams and connections that were refused because another peer holds the port.
    fn refused(&self) -> u64 {
        0
    }

    /// The bound address, for sockets.
    fn local_address(&self) -> Option<SocketAddr>;

    /// Adds the descriptors that [`Transport::receive`] should be called for.
    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>);
}
