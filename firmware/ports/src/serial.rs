//! Serial devices.
//!
//! `serialport` opens, locks and configures the device. Its own reads and writes each wait with a time-out of
//! their own and serve one device only, but the decision loop has one wait for all ports and must never block on a
//! slow line. Therefore the descriptor is set non-blocking here and polled together with the sockets.

use crate::outbox::Outbox;
use crate::tcp::read_now;
use crate::transport::{Down, Transport};
use rustix::event::{PollFd, PollFlags};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::termios::{QueueSelector, tcflush};
use serialport::{ErrorKind, TTYPort};
use std::fs::File;
use std::io;
use std::net::SocketAddr;
use std::os::fd::{FromRawFd, IntoRawFd, OwnedFd};
use std::path::{Path, PathBuf};

/// A serial device in exclusive use: 8 data bits, no parity, 1 stop bit, no flow control.
pub(crate) struct Serial {
    path: PathBuf,
    baud: u32,
    device: Option<File>,
    outbox: Outbox,
}

impl Serial {
    pub(crate) fn open(path: PathBuf, baud: u32) -> io::Result<Serial> {
        let device = Some(open_device(&path, baud)?);
        Ok(Serial { path, baud, device, outbox: Outbox::default() })
    }

    fn lose(&mut self) {
        self.device = None;
        self.outbox.clear();
    }
}

/// Opens the device for this process alone: `serialport` takes an advisory lock against programs that use one, and
/// sets the terminal to exclusive mode (`TIOCEXCL`) against those that do not.
fn open_device(path: &Path, baud: u32) -> io::Result<File> {
    let path = path.to_str().ok_or(io::ErrorKind::InvalidFilename)?;
    let port = serialport::new(path, baud).open_native().map_err(|error| match error.kind() {
        // On Linux: the device is locked or in exclusive mode. A missing device is `Io(NotFound)`.
        ErrorKind::NoDevice => io::ErrorKind::ResourceBusy.into(),
        ErrorKind::Io(kind) => kind.into(),
        ErrorKind::InvalidInput => io::Error::new(io::ErrorKind::InvalidInput, error.description),
        ErrorKind::Unknown => io::Error::other(error.description),
    })?;
    let device = into_file(port);
    fcntl_setfl(&device, fcntl_getfl(&device)? | OFlags::NONBLOCK)?;
    Ok(device)
}

/// The descriptor without `serialport` around it. Lock and exclusive mode belong to the open device and stay.
#[allow(unsafe_code, reason = "the crate gives its descriptor as a number only")]
fn into_file(port: TTYPort) -> File {
    // SAFETY: `into_raw_fd` returns an open descriptor and gives up its ownership.
    File::from(unsafe { OwnedFd::from_raw_fd(port.into_raw_fd()) })
}

impl Transport for Serial {
    fn is_up(&self) -> bool {
        self.device.is_some()
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Down> {
        let Some(device) = &mut self.device else { return Ok(0) };
        let received = self.outbox.flush(device).map_err(Down::from).and_then(|()| read_now(device, buffer));
        received.inspect_err(|_| self.lose())
    }

    fn send(&mut self, frame: &[u8], revocable: bool) -> Result<bool, Down> {
        let Some(device) = &mut self.device else { return Ok(false) };
        let sent = self.outbox.send(frame, revocable, device).map_err(Down::from);
        sent.inspect_err(|_| self.lose())
    }

    /// Also drops what the kernel has not transmitted: it may hold a revoked frame. A frame that is cut by this is
    /// discarded by its receiver.
    fn revoke(&mut self) -> usize {
        if let Some(device) = &self.device {
            // A device that is gone is noticed by the next read.
            let _ = tcflush(device, QueueSelector::OFlush);
        }
        self.outbox.revoke()
    }

    fn reopen(&mut self) -> Result<(), Down> {
        self.device = Some(open_device(&self.path, self.baud)?);
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        None
    }

    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        if let Some(device) = &self.device {
            let out = if self.outbox.is_empty() { PollFlags::empty() } else { PollFlags::OUT };
            watched.push(PollFd::new(device, PollFlags::IN | out));
        }
    }
}
