//! Serial ports against pseudo-terminals: the far end is an open file of the test, the near end a device with a name.

use gleaner_ports::{Down, Port, RETRY_LONGEST, State, wait};
use rustix::fs::{FlockOperation, flock};
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

/// Gives the device a stable name, as a device manager does under /dev/serial/by-id.
fn plug_in(link: &Path) -> File {
    let (far, device) = terminal();
    let _ = std::fs::remove_file(link);
    std::os::unix::fs::symlink(device, link).unwrap();
    far
}

fn open(path: &Path) -> Result<Port, String> {
    open_at(path, 921_600)
}

fn open_at(path: &Path, baud: u32) -> Result<Port, String> {
    let endpoint = format!("serial:{}:{baud}", path.display()).parse().unwrap();
    Port::open(&endpoint).map_err(|error| error.to_string())
}

fn receive(port: &mut Port, bytes: usize) -> Vec<u8> {
    let mut received = Vec::new();
    while received.len() < bytes {
        assert!(wait(&[port], DEADLINE).unwrap(), "only {received:?} arrived");
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
    assert_eq!((port.state(), port.stats().frames_dropped), (State::Up, 0));
    let second = open(&device).err().unwrap();
    assert!(second.ends_with("another program has the device open, stop it"), "{second}");
}

#[test]
fn an_unplugged_device_is_opened_again() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("usb-Example_Modem_A1-if00-port0");
    let far = plug_in(&link);
    let mut port = open(&link).unwrap();
    let mut now = Instant::now();
    assert_eq!(port.maintain(now), None);

    drop(far);
    assert!(wait(&[&port], DEADLINE).unwrap(), "the hang-up ends the wait");
    assert_eq!(port.receive(&mut [0; 16]), 0);
    assert_eq!(port.maintain(now), Some(State::Down(Down::Gone)));
    assert!(!wait(&[&port], Duration::ZERO).unwrap(), "a lost device does not end the next wait");
    std::fs::remove_file(&link).unwrap();
    for _ in 0..3 {
        now += RETRY_LONGEST;
        assert_eq!(port.maintain(now), None, "reported once");
    }
    port.send(b"dropped");
    assert_eq!(port.stats().frames_dropped, 1);

    let mut far = plug_in(&link);
    assert_eq!(port.maintain(now + RETRY_LONGEST), Some(State::Up));
    far.write_all(b"back").unwrap();
    assert_eq!(receive(&mut port, 4), b"back");
}

#[test]
fn a_slow_line_never_blocks_the_sender() {
    let (far, device) = terminal();
    let mut port = open(&device).unwrap();
    while port.stats().frames_dropped < 5 {
        port.send(&[0x55; 280]);
    }
    assert_eq!(port.state(), State::Up);
    drop(far);
}

#[test]
fn files_that_are_no_device_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    File::create(&file).unwrap();
    for (path, expected) in [
        (file, "check that this is a serial device"),
        (folder.path().to_owned(), "check that this is a serial device"),
    ] {
        let error = open(&path).err().unwrap();
        assert!(error.ends_with(expected), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}

#[test]
fn a_missing_device_lists_the_devices_that_exist() {
    let error = open(Path::new("/dev/ttyNOSUCH")).err().unwrap();
    assert!(error.contains("plug the device in"), "{error}");
    assert!(error.contains("there are"), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
}

#[test]
fn the_device_is_ours_alone_while_it_is_open() {
    let (_far, device) = terminal();
    let port = open(&device).unwrap();
    // A program with an advisory lock of its own, as minicom and serialport use.
    if let Ok(other) = File::open(&device) {
        assert!(flock(&other, FlockOperation::NonBlockingLockExclusive).is_err());
    }
    drop(port);
    let other = File::open(&device).unwrap();
    flock(&other, FlockOperation::NonBlockingLockExclusive).unwrap();
    let busy = open(&device).err().unwrap();
    assert!(busy.ends_with("another program has the device open, stop it"), "{busy}");
}

#[test]
fn unusual_baud_rates_are_set() {
    for baud in [57_600, 420_000, 921_600, 1_234_567] {
        let (far, device) = terminal();
        let _port = open_at(&device, baud).unwrap();
        // Both ends of a pseudo-terminal share their settings.
        let settings = rustix::termios::tcgetattr(&far).unwrap();
        assert_eq!((settings.output_speed(), settings.input_speed()), (baud, baud));
    }
}

#[test]
fn revoked_frames_do_not_leave_a_slow_line() {
    let (mut far, device) = terminal();
    let mut port = open(&device).unwrap();
    // Fill the kernel's buffer and the queue.
    while port.stats().frames_dropped < 1 {
        port.send(&[0x55; 280]);
    }
    let mut buffer = [0; 4096];
    // The kernel hands bytes over in its own time: drain until the queue has room for the frame.
    loop {
        let bytes = far.read(&mut buffer).unwrap();
        assert!(buffer[..bytes].iter().all(|&byte| byte == 0x55));
        port.receive(&mut [0; 16]);
        let dropped = port.stats().frames_dropped;
        port.send_revocable(&[0xAA; 50]);
        if port.stats().frames_dropped == dropped {
            break;
        }
    }
    assert_eq!(port.revoke(), 1);
    port.send(&[0x66; 50]);
    let mut last = 0;
    while last != 0x66 {
        port.receive(&mut [0; 16]);
        let bytes = far.read(&mut buffer).unwrap();
        assert!(!buffer[..bytes].contains(&0xAA), "the revoked frame left");
        last = buffer[bytes - 1];
    }
}
