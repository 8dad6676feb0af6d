//! The server over real sockets: what a viewer gets, and what is refused.

use gleaner_dashboard::{Access, Command, Event, Grid, Order, Scene, Server, Text, Token};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

/// A test fails instead of waiting for ever.
const DEADLINE: Duration = Duration::from_secs(20);

fn scene() -> Scene {
    Scene {
        title: "test".into(),
        grid: Grid { width: 2, height: 1, cell_m: 20.0, rotation_deg: 0.0 },
        heights_m: vec![0, 12],
        fence: None,
        sight: Vec::new(),
        altitude_m: 60,
        terminal: [0, 0],
        devices: Vec::new(),
        battery_units: 80.0,
        controls: true,
        incidents: Vec::new(),
    }
}

fn start(access: Access) -> Server {
    Server::start("127.0.0.1:0".parse().unwrap(), access, scene()).unwrap()
}

/// A connection on which a request was sent.
fn ask(address: SocketAddr, request: &str, headers: &str, body: &str) -> BufReader<TcpStream> {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(DEADLINE)).unwrap();
    let length = body.len();
    write!(
        stream,
        "{request} HTTP/1.1\r\nHost: {address}\r\nContent-Type: application/json\r\n\
         Content-Length: {length}\r\n{headers}\r\n{body}"
    )
    .unwrap();
    BufReader::new(stream)
}

fn status(reader: &mut BufReader<TcpStream>) -> u16 {
    let mut line = String::new();
    reader.read_line(&mut line).unwrap();
    line.split(' ').nth(1).unwrap().parse().unwrap()
}

fn next_order(server: &mut Server) -> Order {
    let begun = Instant::now();
    loop {
        if let Some(order) = server.order() {
            return order;
        }
        assert!(begun.elapsed() < DEADLINE, "no order arrived");
        std::thread::yield_now();
    }
}

/// Lines of the stream until one that begins with `start`.
fn until(reader: &mut BufReader<TcpStream>, start: &str) -> String {
    loop {
        let mut line = String::new();
        assert_ne!(reader.read_line(&mut line).unwrap(), 0, "the stream ended before {start}");
        if line.starts_with(start) {
            return line;
        }
    }
}

#[test]
fn a_viewer_gets_the_flight_and_then_its_events() {
    let mut server = start(Access::Loopback);
    server.publish(Event::Text(Text { t_s: 1.0, severity: 6, text: "before".into() }));
    // A viewer whose first message holds the text comes after the event; until then the next viewer tries.
    let mut stream = loop {
        let mut stream = ask(server.address(), "GET /api/events", "", "");
        assert_eq!(status(&mut stream), 200);
        until(&mut stream, "event: flight");
        if until(&mut stream, "data: ").contains("before") {
            break stream;
        }
    };
    server.publish(Event::Text(Text { t_s: 2.0, severity: 6, text: "after".into() }));
    until(&mut stream, "event: text");
    assert!(until(&mut stream, "data: ").contains("after"));
    assert_eq!(server.dropped(), 0);
    drop(server);
    let mut rest = Vec::new();
    // The stream ends with the program; how the socket closes does not matter.
    let _ = stream.read_to_end(&mut rest);
}

#[test]
fn a_command_reaches_the_loop_and_its_answer_the_viewer() {
    let mut server = start(Access::Loopback);
    let mut reply = ask(server.address(), "POST /api/command", "", r#"{"preference":0.25}"#);
    let order = next_order(&mut server);
    assert_eq!(order.command, Command::Preference(0.25));
    order.answer("acknowledged: accepted");
    assert_eq!(status(&mut reply), 200);
    until(&mut reply, r#"{"words":"acknowledged: accepted"}"#);
}

#[test]
fn bad_commands_and_foreign_pages_are_refused() {
    let mut server = start(Access::Loopback);
    let address = server.address();
    let refused = |headers: &str, body: &str| status(&mut ask(address, "POST /api/command", headers, body));
    assert_eq!(refused("Origin: https://evil.example\r\n", r#"{"preference":0.25}"#), 403);
    assert_eq!(refused("", r#"{"preference":7}"#), 400);
    assert_eq!(refused("", r#"{"launch":true}"#), 422);
    assert_eq!(refused("", &format!(r#"{{"incident":"{}"}}"#, "x".repeat(2000))), 413);
    assert_eq!(status(&mut ask(address, "GET /api/secrets", "", "")), 404);
    assert!(server.order().is_none(), "nothing of this may reach the loop");
}

#[test]
fn tokens_part_viewers_from_commanders() {
    let (view, control) = (Token::random().unwrap(), Token::random().unwrap());
    let (view_secret, control_secret) = (view.secret().to_owned(), control.secret().to_owned());
    let mut server = start(Access::Tokens { view, control });
    let address = server.address();
    let bearer = |token: &str| format!("Authorization: Bearer {token}\r\n");
    assert_eq!(status(&mut ask(address, "GET /", "", "")), 200, "the page itself holds no secret");
    assert_eq!(status(&mut ask(address, "GET /api/events", "", "")), 401);
    assert_eq!(status(&mut ask(address, "GET /api/events", &bearer("wrong-but-long-enough"), "")), 401);
    assert_eq!(status(&mut ask(address, "GET /api/events", &bearer(&view_secret), "")), 200);
    let command = r#"{"request":"return"}"#;
    assert_eq!(status(&mut ask(address, "POST /api/command", &bearer(&view_secret), command)), 403);
    assert!(server.order().is_none());
    let mut reply = ask(address, "POST /api/command", &bearer(&control_secret), command);
    next_order(&mut server).answer("acknowledged: accepted");
    assert_eq!(status(&mut reply), 200);
}

#[test]
fn viewers_are_bounded() {
    let server = start(Access::Loopback);
    let mut streams: Vec<_> = (0..16).map(|_| ask(server.address(), "GET /api/events", "", "")).collect();
    assert!(streams.iter_mut().all(|stream| status(stream) == 200));
    assert_eq!(status(&mut ask(server.address(), "GET /api/events", "", "")), 503);
}

#[test]
fn a_full_channel_never_holds_the_loop() {
    let mut server = start(Access::Loopback);
    for index in 0..100_000 {
        server.publish(Event::Text(Text { t_s: f64::from(index), severity: 6, text: "flood".into() }));
    }
    // Whatever the server's thread took meanwhile, the calls returned.
    assert!(server.dropped() < 100_000);
}
