//! What each kind of port does, and why it may not.

use rustix::event::PollFd;
use std::io;
use std::net::SocketAddr;

/// Why a port is down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Down {
    /// Nobody has connected yet.
    #[error("nobody has connected yet")]
    NoPeer,
    /// The peer closed the connection, or the device was unplugged.
    #[error("the other side is gone")]
    Gone,
    /// The operating system said so.
    #[error("{0}")]
    Failed(io::ErrorKind),
}

impl From<io::Error> for Down {
    fn from(error: io::Error) -> Down {
        match error.kind() {
            // What a terminal says after its device was unplugged (EIO has no kind of its own).
            _ if error.raw_os_error() == Some(rustix::io::Errno::IO.raw_os_error()) => Down::Gone,
            io::ErrorKind::BrokenPipe | io::ErrorKind::ConnectionReset => Down::Gone,
            kind => Down::Failed(kind),
        }
    }
}

/// One kind of port. No method may block. After an `Err` the transport must not be up.
pub(crate) trait Transport {
    /// Whether bytes can travel now.
    fn is_up(&self) -> bool;

    /// Reads what is there, 0 for nothing now. Also finishes whatever is pending: connections to accept or to
    /// complete, bytes to flush.
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down>;

    /// Sends one frame; `false` when it was dropped.
    fn send(&mut self, frame: &[u8]) -> Result<bool, Down>;

    /// Begins to open again; called only while not up.
    fn reopen(&mut self) -> Result<(), Down>;

    /// The bound address, for sockets.
    fn local_address(&self) -> Option<SocketAddr>;

    /// Adds what [`Transport::receive`] should be called for.
    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>);
}
