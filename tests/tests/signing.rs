//! MAVLink 2 signing, judged by pymavlink as the signing client.
//!
//! The link runs behind a UDP socket in this process, as a program would run it: one decoder and one [`Signing`] per
//! port. Run it alone with `cargo test --release --workspace --test signing`.

use gleaner_link::{
    Component, FrameBytes, FrameDecoder, Parameters, Settings, Signing, SigningKey, SigningStats,
    SigningTime, Status, SystemState,
};
use gleaner_tests::python;
use gleaner_units::Instant;
use std::net::{SocketAddr, UdpSocket};
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

const PASSPHRASE: &str = "a passphrase of this test";

/// A component behind one signed UDP port.
struct Port {
    socket: UdpSocket,
    peer: Option<SocketAddr>,
    decoder: FrameDecoder,
    signing: Signing,
    component: Component,
    started: std::time::Instant,
}

fn wall() -> SigningTime {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    SigningTime::from_unix_micros(since_1970.as_micros() as u64)
}

impl Port {
    fn new() -> Port {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let settings = Settings::new(Some(1), 191).unwrap();
        Port {
            socket,
            peer: None,
            decoder: FrameDecoder::new(),
            signing: Signing::new(SigningKey::from_passphrase(PASSPHRASE), 0, wall(), None),
            component: Component::new(settings, Parameters::default()),
            started: std::time::Instant::now(),
        }
    }

    /// One turn of a program's loop.
    fn turn(&mut self) {
        let now = Instant::from_millis(self.started.elapsed().as_millis() as u64);
        self.signing.set_clock(wall());
        let mut datagram = [0; 2048];
        if let Ok((length, from)) = self.socket.recv_from(&mut datagram) {
            self.decoder.begin_datagram();
            let mut bytes = &datagram[..length];
            while let Some(frame) = self.decoder.read(&mut bytes) {
                if self.signing.check(&frame).is_ok() {
                    self.peer = Some(from);
                    self.component.receive_frame(now, &frame);
                }
            }
        }
        self.component.poll(now, &Status { state: SystemState::Standby, may_engage: true, may_return: true });
        let mut frame = FrameBytes::new();
        frame.resize_default(frame.capacity()).unwrap();
        loop {
            let length = self.component.transmit(&mut frame);
            if length == 0 {
                return;
            }
            if let (Some(peer), Some(signed)) = (self.peer, self.signing.sign(&frame[..length])) {
                self.socket.send_to(&signed, peer).unwrap();
            }
        }
    }
}

#[test]
fn pymavlink_accepts_our_signatures_and_we_accept_its() {
    let mut port = Port::new();
    let connection = format!("udpout:{}", port.socket.local_addr().unwrap());
    let client = thread::spawn(move || python::run("signing_client.py", [connection.as_str(), PASSPHRASE]));
    while !client.is_finished() {
        port.turn();
    }
    client.join().unwrap().unwrap_or_else(|cause| panic!("{cause:#}\n{:?}", port.signing.stats()));
    let SigningStats { replayed, unsigned, wrong, .. } = port.signing.stats();
    assert_eq!((replayed, unsigned, wrong), (1, 1, 1));
    assert_eq!(port.component.parameters().data_weight(), 1.0, "only the signed commands counted");
}
