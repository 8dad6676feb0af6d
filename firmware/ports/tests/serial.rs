//! Serial ports against pseudo-terminals: the far end is a file that we hold, the near end a device with a name.

use gleaner_ports::{Down, Port, RETRY_LONGEST, State, wait};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const DEADLINE: Duration = Duration::from_secs(20);

/// The far end, and the name of the near one.
fn terminal() -> (File, PathBuf) {
    let far = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&far).unwrap();
    unlockpt(&far).unwrap();
    let name = ptsname(&far, Vec::new()).unwrap();
    (File::from(far), PathBuf::from(std::ffi::OsStr::from_bytes(name.as_bytes())))
}

/// As a device manager does when a device appears under its usual name.
fn plug_in(link: &Path) -> File {
    let (far, device) = terminal();
    let _ = std::fs::remove_file(link);
    std::os::unix::fs::symlink(device, link).unwrap();
    far
}

fn open(path: &Path) -> Result<Port, String> {
    let endpoint = format!("serial:{}:921600", path.display()).parse().unwrap();
    Port::open(&endpoint).map_err(|error| error.to_string())
}

fn receive(port: &mut Port, bytes: usize) -> Vec<u8> {
    let mut received = Vec::new();
    while received.len() < bytes {
        assert!(wait(&[port], DEADLINE).unwrap(), "only {received:?} came");
        let mut buffer = [0; 1024];
        let now = port.receive(&mut buffer);
        received.extend(&buffer[..now]);
    }
    received
}

#[test]
fn every_byte_passes_unchanged_in_both_directions() {
    let (mut far, device) = terminal();
    let mut port = open(&device).unwrap();
    assert_eq!(port.receive(&mut [0; 16]), 0);
    // Includes XON, XOFF, interrupt, end of file, newline and carriage return.
    let all: Vec<u8> = (0..=255).collect();
    far.write_all(&all).unwrap();
    assert_eq!(receive(&mut port, 256), all);
    port.send(&all);
    let mut back = [0; 256];
    far.read_exact(&mut back).unwrap();
    assert_eq!(back[..], all);
    assert_eq!((port.state(), port.dropped_frames()), (State::Up, 0));
    let second = open(&device).err().unwrap();
    assert!(second.ends_with("another program has the device open, stop it"), "{second}");
}

#[test]
fn a_device_that_is_unplugged_is_opened_again_when_it_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("ttyRADIO");
    let far = plug_in(&link);
    let mut port = open(&link).unwrap();
    let mut now = Instant::now();
    assert_eq!(port.maintain(now), None);

    drop(far);
    assert!(wait(&[&port], DEADLINE).unwrap(), "the hang-up wakes us");
    assert_eq!(port.receive(&mut [0; 16]), 0);
    assert_eq!(port.maintain(now), Some(State::Down(Down::Gone)));
    assert!(!wait(&[&port], Duration::ZERO).unwrap(), "a lost device does not keep us awake");
    std::fs::remove_file(&link).unwrap();
    for _ in 0..3 {
        now += RETRY_LONGEST;
        assert_eq!(port.maintain(now), None, "said once");
    }
    port.send(b"dropped");
    assert_eq!(port.dropped_frames(), 1);

    let mut far = plug_in(&link);
    assert_eq!(port.maintain(now + RETRY_LONGEST), Some(State::Up));
    far.write_all(b"back").unwrap();
    assert_eq!(receive(&mut port, 4), b"back");
}

#[test]
fn a_slow_line_never_blocks_the_sender() {
    let (far, device) = terminal();
    let mut port = open(&device).unwrap();
    while port.dropped_frames() < 5 {
        port.send(&[0x55; 280]);
    }
    assert_eq!(port.state(), State::Up);
    drop(far);
}

#[test]
fn what_is_no_serial_device_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    File::create(&file).unwrap();
    for (path, expected) in [
        (folder.path().join("missing"), "plug the device in, or look for its name in /dev/serial/by-id"),
        (file, "check that this is a serial device"),
        (folder.path().to_owned(), "check that this is a serial device"),
    ] {
        let error = open(&path).err().unwrap();
        assert!(error.ends_with(expected), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}
