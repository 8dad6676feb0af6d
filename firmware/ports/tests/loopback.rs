//! Ports against plain sockets on loopback. Nothing sleeps: every wait is for an event, with a deadline that only
//! a failing test reaches. Peers are in `peers.rs`.

use gleaner_ports::{Down, Endpoint, Port, RETRY_LONGEST, State, wait};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::time::{Duration, Instant};

const DEADLINE: Duration = Duration::from_secs(20);

fn open(text: &str) -> Port {
    Port::open(&text.parse::<Endpoint>().unwrap()).unwrap()
}

/// Reads until `bytes` bytes have arrived.
fn receive(port: &mut Port, bytes: usize) -> Vec<u8> {
    let mut received = Vec::new();
    while received.len() < bytes {
        let mut buffer = [0; 1024];
        let now = port.receive(&mut buffer);
        received.extend(&buffer[..now]);
        if now == 0 {
            assert!(wait(&[port], DEADLINE).unwrap(), "only {received:?} arrived");
        }
    }
    received
}

/// Works the port until it reports a change of state.
fn next_state(port: &mut Port, now: Instant) -> State {
    loop {
        port.receive(&mut [0; 16]);
        if let Some(state) = port.maintain(now) {
            return state;
        }
        assert!(wait(&[port], DEADLINE).unwrap(), "no change of state");
    }
}

fn accept(listener: &TcpListener) -> TcpStream {
    let stream = listener.accept().unwrap().0;
    stream.set_read_timeout(Some(DEADLINE)).unwrap();
    stream
}

#[test]
fn a_listening_udp_port_answers_all_senders() {
    let mut port = open("udpin:127.0.0.1:0");
    port.send(b"no peer yet");
    assert_eq!((port.stats().frames_dropped, port.receive(&mut [0; 16])), (0, 0));
    let peers: Vec<UdpSocket> = (0..2)
        .map(|_| {
            let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
            peer.set_read_timeout(Some(DEADLINE)).unwrap();
            peer.connect(port.local_address().unwrap()).unwrap();
            peer
        })
        .collect();
    for peer in &peers {
        peer.send(b"").unwrap();
        peer.send(b"hello").unwrap();
        assert_eq!(receive(&mut port, 1), b"hello", "one call gives one datagram");
    }
    port.send(b"to all");
    for peer in &peers {
        let mut buffer = [0; 16];
        assert_eq!(peer.recv(&mut buffer).unwrap(), 6);
        assert_eq!(&buffer[..6], b"to all");
    }
}

#[test]
fn a_sending_udp_port_survives_refused_datagrams() {
    let address = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let mut port = open(&format!("udpout:{address}"));
    port.send(b"refused");
    assert!(wait(&[&port], DEADLINE).unwrap(), "the refusal ends the wait");
    assert_eq!(port.receive(&mut [0; 16]), 0);
    assert!(!wait(&[&port], Duration::ZERO).unwrap(), "and does not end the next one");
    assert_eq!((port.maintain(Instant::now()), port.state()), (None, State::Up));
    let peer = UdpSocket::bind(address).unwrap();
    port.send(b"heard");
    let mut buffer = [0; 16];
    let (bytes, from) = peer.recv_from(&mut buffer).unwrap();
    assert_eq!(&buffer[..bytes], b"heard");
    peer.send_to(b"and answered", from).unwrap();
    assert_eq!(receive(&mut port, 1), b"and answered");
}

#[test]
fn a_connecting_tcp_port_reconnects() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut port = open(&format!("tcpout:{}", listener.local_addr().unwrap()));
    let mut peer = accept(&listener);
    port.send(b"hello");
    let mut buffer = [0; 5];
    peer.read_exact(&mut buffer).unwrap();
    assert_eq!(&buffer, b"hello");

    drop(peer);
    let start = Instant::now();
    assert_eq!(next_state(&mut port, start), State::Down(Down::Gone));
    assert_eq!(port.maintain(start), None, "the first attempt waits");
    assert_eq!(port.local_address(), None);
    assert_eq!(next_state_from_attempt(&mut port, start + RETRY_LONGEST), State::Up);
    accept(&listener).write_all(b"again").unwrap();
    assert_eq!(receive(&mut port, 5), b"again");
}

#[test]
fn failed_attempts_to_reconnect_are_not_reported_again() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let mut port = open(&format!("tcpout:{address}"));
    drop(accept(&listener));
    drop(listener);
    let mut now = Instant::now();
    assert!(matches!(next_state(&mut port, now), State::Down(_)));
    for _ in 0..3 {
        now += RETRY_LONGEST;
        assert_eq!(port.maintain(now), None);
        while port.local_address().is_some() {
            assert!(wait(&[&port], DEADLINE).unwrap());
            port.receive(&mut [0; 16]);
        }
        assert_eq!(port.maintain(now), None);
    }
    assert_eq!(port.state(), State::Down(Down::Failed(std::io::ErrorKind::ConnectionRefused)));
    let listener = TcpListener::bind(address).unwrap();
    now += RETRY_LONGEST;
    assert_eq!(next_state_from_attempt(&mut port, now), State::Up);
    accept(&listener);
}

/// Like [`next_state`], for a port that has no attempt under way yet.
fn next_state_from_attempt(port: &mut Port, now: Instant) -> State {
    port.maintain(now).unwrap_or_else(|| next_state(port, now))
}

#[test]
fn a_slow_tcp_peer_gets_whole_frames() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut port = open(&format!("tcpout:{}", listener.local_addr().unwrap()));
    let mut peer = accept(&listener);
    let frame = |index: u32| {
        let mut frame = [0; 280];
        frame[..4].copy_from_slice(&index.to_le_bytes());
        frame
    };
    let mut offered = 0;
    while port.stats().frames_dropped < 10 {
        port.send(&frame(offered));
        offered += 1;
    }
    let mut buffer = [0; 280];
    let mut last = None;
    for _ in 0..offered - 10 {
        // Queued frames leave when the port is read.
        port.receive(&mut [0; 16]);
        peer.read_exact(&mut buffer).unwrap();
        let index = u32::from_le_bytes(buffer[..4].try_into().unwrap());
        assert!(last < Some(index), "{index} after {last:?}");
        assert_eq!(buffer, frame(index));
        last = Some(index);
    }
    assert_eq!(port.state(), State::Up);
}

#[test]
fn a_wait_for_several_ports_ends_for_any() {
    let silent = open("tcpin:127.0.0.1:0");
    let mut spoken = open("udpin:127.0.0.1:0");
    assert!(!wait(&[&silent, &spoken], Duration::ZERO).unwrap());
    let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
    peer.send_to(b"x", spoken.local_address().unwrap()).unwrap();
    assert!(wait(&[&silent, &spoken], DEADLINE).unwrap());
    assert_eq!(spoken.receive(&mut [0; 16]), 1);
    assert!(!wait(&[&silent, &spoken], Duration::ZERO).unwrap());
    assert!(!wait(&[], Duration::ZERO).unwrap());
}

#[test]
fn open_errors_say_what_to_do() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let busy = format!("udpin:{}", taken.local_addr().unwrap());
    let closed = format!("tcpout:{closed}");
    for (text, expected) in [
        (busy.as_str(), "stop the other program that uses this port, or choose another number"),
        (closed.as_str(), "start the other side first, or correct host and port"),
        ("udpin:192.0.2.1:14550", "use an address of this machine, or 0.0.0.0 for all of them"),
    ] {
        let error = Port::open(&text.parse().unwrap()).err().unwrap().to_string();
        assert!(error.starts_with(text) && error.ends_with(expected), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}

#[test]
fn a_dual_stack_port_receives_ipv4_and_ipv6() {
    let mut port = open("udpin:[::]:0");
    let number = port.local_address().unwrap().port();
    for (own, to) in [("127.0.0.1:0", format!("127.0.0.1:{number}")), ("[::1]:0", format!("[::1]:{number}"))]
    {
        UdpSocket::bind(own).unwrap().send_to(b"hello", to).unwrap();
        assert_eq!(receive(&mut port, 5), b"hello");
    }
}

#[test]
fn an_unknown_host_is_down_until_it_gets_an_address() {
    for kind in ["udpout", "tcpout"] {
        let mut port = open(&format!("{kind}:no-such-host.invalid:5760"));
        assert_eq!(port.state(), State::Down(Down::Unresolved));
        port.send(b"dropped");
        assert_eq!(port.stats().frames_dropped, 1);
        let start = Instant::now();
        assert_eq!(port.maintain(start), None);
        assert_eq!(port.maintain(start + RETRY_LONGEST), None, "still no address");
        assert_eq!(port.state(), State::Down(Down::Unresolved));
    }
}

#[test]
fn a_broadcast_port_receives_answers_of_single_hosts() {
    let peer = UdpSocket::bind("0.0.0.0:0").unwrap();
    peer.set_read_timeout(Some(DEADLINE)).unwrap();
    let mut port = open(&format!("udpbcast:127.255.255.255:{}", peer.local_addr().unwrap().port()));
    port.send(b"to all");
    let mut buffer = [0; 16];
    let (bytes, from) = peer.recv_from(&mut buffer).unwrap();
    assert_eq!(&buffer[..bytes], b"to all");
    peer.send_to(b"answer", from).unwrap();
    assert_eq!(receive(&mut port, 1), b"answer");
}
