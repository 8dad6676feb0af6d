//! Which peers a listening port serves. Time is an argument, so nothing waits for it.

use gleaner_ports::{Down, PEER_SILENCE, Peers, Port, State, wait};
use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::time::{Duration, Instant};

const DEADLINE: Duration = Duration::from_secs(20);
const SECOND: Duration = Duration::from_secs(1);

fn open(text: &str, peers: Peers) -> Port {
    Port::open_for(&text.parse().unwrap(), peers).unwrap()
}

fn udp_peer(port: &Port) -> UdpSocket {
    let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
    peer.connect(port.local_address().unwrap()).unwrap();
    peer.set_read_timeout(Some(DEADLINE)).unwrap();
    peer
}

/// The next bytes; none if the datagram was refused.
fn next(port: &mut Port) -> Vec<u8> {
    assert!(wait(&[port], DEADLINE).unwrap());
    let mut buffer = [0; 64];
    let bytes = port.receive(&mut buffer);
    buffer[..bytes].to_vec()
}

fn received(peer: &UdpSocket) -> Vec<u8> {
    let mut buffer = [0; 64];
    let bytes = peer.recv(&mut buffer).unwrap();
    buffer[..bytes].to_vec()
}

#[test]
fn a_bound_udp_port_sends_nothing_before_a_peer_is_confirmed() {
    let mut port = open("udpin:127.0.0.1:0", Peers::Bound);
    let (noise, autopilot) = (udp_peer(&port), udp_peer(&port));
    noise.send(b"noise").unwrap();
    assert_eq!(next(&mut port), b"noise");
    port.send(b"first");
    autopilot.send(b"heartbeat").unwrap();
    assert_eq!(next(&mut port), b"heartbeat");
    port.confirm_peer();
    port.send(b"second");
    assert_eq!(received(&autopilot), b"second");
    noise.set_nonblocking(true).unwrap();
    assert!(noise.recv(&mut [0; 64]).is_err(), "an unconfirmed sender gets no answer");
}

#[test]
fn a_bound_udp_port_refuses_other_senders_until_its_peer_is_silent() {
    let mut port = open("udpin:127.0.0.1:0", Peers::Bound);
    let start = Instant::now();
    let (autopilot, intruder) = (udp_peer(&port), udp_peer(&port));
    autopilot.send(b"heartbeat").unwrap();
    next(&mut port);
    port.confirm_peer();
    port.maintain(start);
    intruder.send(b"mine").unwrap();
    assert_eq!((next(&mut port), port.stats().refused), (vec![], 1));

    // A confirmed heartbeat extends the time.
    autopilot.send(b"heartbeat").unwrap();
    next(&mut port);
    port.confirm_peer();
    port.maintain(start + PEER_SILENCE - SECOND);
    intruder.send(b"mine").unwrap();
    assert_eq!(next(&mut port), b"");

    port.maintain(start + 2 * PEER_SILENCE);
    port.send(b"to no one");
    intruder.send(b"mine").unwrap();
    assert_eq!(next(&mut port), b"mine");
    port.confirm_peer();
    port.send(b"hello");
    assert_eq!(received(&intruder), b"hello");
}

#[test]
fn a_reply_goes_to_the_sender_of_the_last_datagram() {
    let mut port = open("udpin:127.0.0.1:0", Peers::Bound);
    let gateway = udp_peer(&port);
    gateway.send(b"data").unwrap();
    next(&mut port);
    port.reply(b"ack");
    assert_eq!(received(&gateway), b"ack");
}

/// Reads the port until its state changes.
fn next_state(port: &mut Port, now: Instant) -> State {
    loop {
        port.receive(&mut [0; 16]);
        if let Some(state) = port.maintain(now) {
            return state;
        }
        assert!(wait(&[port], DEADLINE).unwrap(), "no change of state");
    }
}

#[test]
fn a_new_connection_does_not_evict_a_living_one() {
    let mut port = open("tcpin:127.0.0.1:0", Peers::All);
    let start = Instant::now();
    assert_eq!(port.state(), State::Down(Down::NoPeer));
    port.send(b"dropped");
    assert_eq!(port.stats().frames_dropped, 1);

    let address = port.local_address().unwrap();
    let mut first = TcpStream::connect(address).unwrap();
    assert_eq!(next_state(&mut port, start), State::Up);
    let mut second = TcpStream::connect(address).unwrap();
    second.set_read_timeout(Some(DEADLINE)).unwrap();
    while port.stats().refused == 0 {
        assert!(wait(&[&port], DEADLINE).unwrap());
        port.receive(&mut [0; 16]);
    }
    assert_eq!(second.read(&mut [0; 16]).unwrap(), 0, "the second was closed");
    first.write_all(b"still here").unwrap();
    assert_eq!(next(&mut port), b"still here");

    drop(first);
    assert_eq!(next_state(&mut port, start), State::Down(Down::Gone));
    assert_eq!(port.maintain(start), None, "reported once");
}

#[test]
fn a_silent_connection_gives_way_to_a_new_one() {
    let mut port = open("tcpin:127.0.0.1:0", Peers::All);
    let start = Instant::now();
    let address = port.local_address().unwrap();
    let mut first = TcpStream::connect(address).unwrap();
    assert_eq!(next_state(&mut port, start), State::Up);
    port.maintain(start + PEER_SILENCE);
    let mut second = TcpStream::connect(address).unwrap();
    second.write_all(b"two").unwrap();
    let mut bytes = Vec::new();
    while bytes.is_empty() {
        bytes = next(&mut port);
    }
    assert_eq!(bytes, b"two");
    port.send(b"to the second");
    let mut buffer = [0; 13];
    second.read_exact(&mut buffer).unwrap();
    assert_eq!(&buffer, b"to the second");
    first.set_read_timeout(Some(DEADLINE)).unwrap();
    assert_eq!(first.read(&mut buffer).unwrap(), 0, "the first was closed");
}
