//! Serial devices.
//!
//! The terminal is set up here through `rustix`: the usual serial crates hand out descriptors that block while
//! the line is slow, and that cannot be waited for together with sockets.

use crate::outbox::Outbox;
use crate::tcp::read_now;
use crate::transport::{Down, Transport};
use rustix::event::{PollFd, PollFlags};
use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
use rustix::termios::{ControlModes, InputModes, OptionalActions, SpecialCodeIndex, tcgetattr, tcsetattr};
use std::fs::File;
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

/// A serial device, 8N1, no flow control, ours alone.
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

fn open_device(path: &Path, baud: u32) -> io::Result<File> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let device = open(path, flags, Mode::empty())?;
    // Two readers would each get half of the frames.
    flock(&device, FlockOperation::NonBlockingLockExclusive)?;
    let mut settings = tcgetattr(&device)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
    settings.control_modes -= ControlModes::CSTOPB | ControlModes::CRTSCTS;
    settings.input_modes -= InputModes::IXON | InputModes::IXOFF;
    // With these a read of nothing says "would block", and only an unplugged device reads as the end.
    settings.special_codes[SpecialCodeIndex::VMIN] = 1;
    settings.special_codes[SpecialCodeIndex::VTIME] = 0;
    settings.set_speed(baud)?;
    tcsetattr(&device, OptionalActions::Now, &settings)?;
    Ok(File::from(device))
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

    fn send(&mut self, frame: &[u8]) -> Result<bool, Down> {
        let Some(device) = &mut self.device else { return Ok(false) };
        let sent = self.outbox.send(frame, device).map_err(Down::from);
        sent.inspect_err(|_| self.lose())
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
