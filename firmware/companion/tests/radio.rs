//! Radios in each format, from the port to the decision.

mod fixture;

use fixture::Fixture;
use fixture::vehicle::{FakeAutopilot, Running};
use gleaner_radio::{Report, encode};
use gleaner_units::Db;
use serde_json::{Value, json};
use serialport::{SerialPort, TTYPort};
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::process::Stdio;

/// A fixture whose configuration begins with these lines.
fn with(lines: &str) -> Fixture {
    let fixture = Fixture::new();
    fixture.edit("gleaner.toml", "model =", &format!("{lines}\nmodel ="));
    fixture
}

/// Runs until a decision was taken after `send` has sent to the radio's port. Returns the device's remaining data and
/// SNR as the policy saw them last, and what the program printed at its end.
fn decided(fixture: &Fixture, mut send: impl FnMut(&str)) -> (Value, String) {
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    let radio = running.says("radio port ");
    send(&radio);
    autopilot.await_decision();
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    let text = std::fs::read_to_string(fixture.path("log/decisions.jsonl")).unwrap();
    let last: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    let device = &last["tokens"]["devices"][0];
    (json!([device[2], device[3]]), rest)
}

/// A socket that sends to the local address at the end of the line.
fn gateway(line: &str) -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(line.split("local address ").last().unwrap()).unwrap();
    socket.set_read_timeout(Some(std::time::Duration::from_secs(20))).unwrap();
    socket
}

#[test]
fn cobs_frames_over_udp_reach_the_policy() {
    let fixture = with("radio = \"udpin:127.0.0.1:0\"");
    let report = Report { device: 1, snr: Db(7.5), remaining: Some(4000.0), age_ms: 0 };
    let (device, rest) = decided(&fixture, |line| {
        gateway(line).send(&encode(&report)).unwrap();
    });
    assert_eq!(device, json!([4000.0, 7.5]));
    assert!(rest.contains(" bytes, 1 reports"), "{rest}");
}

#[test]
fn json_lines_over_udp_are_calibrated_by_the_configuration() {
    let fixture = with(
        "radio = \"udpin:127.0.0.1:0\"\nradio_format = \"json_lines\"\nradio_snr = { offset_db = 3.0, slope = 0.5 }",
    );
    let (device, rest) = decided(&fixture, |line| {
        let gateway = gateway(line);
        gateway.send(b"{\"id\":1,\"snr_db\":9,\"remaining\":5000,\"age_s\":0.2}").unwrap();
        gateway.send(b"{\"id\":4000000000,\"snr_db\":9}").unwrap();
    });
    assert_eq!(device, json!([5000.0, 7.5]));
    assert!(rest.contains(" bytes, 2 reports"), "{rest}");
}

#[test]
fn json_lines_over_a_serial_port_reach_the_policy() {
    let (mut modem, slave) = TTYPort::pair().unwrap();
    let path = slave.name().unwrap();
    let fixture = with(&format!("radio = \"serial:{path}:115200\"\nradio_format = \"json_lines\""));
    let (device, _) = decided(&fixture, |_| {
        modem.write_all(b"boot\r\n{\"id\":1,\"snr_db\":6.5}\r\n").unwrap();
    });
    assert_eq!(device, json!([6000.0, 6.5]), "without remaining data the mission's figure stands");
}

/// A LoRaWAN gateway: the device is named by its DevAddr, and gets its link margin as SNR.
#[test]
fn a_packet_forwarder_is_acknowledged_and_its_uplinks_reach_the_policy() {
    let fixture = with("radio = \"udpin:127.0.0.1:0\"\nradio_format = \"semtech_udp\"");
    fixture.edit("mission.toml", "id = 1", "dev_addr = \"26011BDA\"");
    let (device, _) = decided(&fixture, |line| {
        let gateway = gateway(line);
        let head = |kind: u8| vec![2, 0x12, 0x34, kind, 0xAA, 0x55, 0x5A, 0, 0, 0, 1, 1];
        let mut push = head(0);
        push.extend_from_slice(
            br#"{"rxpk":[{"tmst":3512348611,"freq":866.3,"stat":1,"modu":"LORA","datr":"SF7BW125","lsnr":5.1,"size":14,"data":"QNobASaAAQABqgECAwQ="}]}"#,
        );
        let mut answer = [0; 16];
        gateway.send(&push).unwrap();
        assert_eq!(gateway.recv(&mut answer).unwrap(), 4);
        assert_eq!(answer[..4], [2, 0x12, 0x34, 1], "PUSH_ACK");
        gateway.send(&head(2)).unwrap();
        assert_eq!(gateway.recv(&mut answer).unwrap(), 4);
        assert_eq!(answer[..4], [2, 0x12, 0x34, 4], "PULL_ACK");
    });
    assert_eq!(device[0], 6000.0);
    // 5.1 dB at SF7 is 12.6 dB above the limit of -7.5 dB, which is 5 dB on the policy's scale.
    assert!((device[1].as_f64().unwrap() - 17.6).abs() < 1e-3, "{device}");
}

#[test]
fn bytes_that_are_no_reports_are_named_to_the_operator() {
    let fixture = with("radio = \"udpin:127.0.0.1:0\"");
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    let gateway = gateway(&running.says("radio port "));
    for _ in 0..4 {
        gateway.send(b"+RCV=1,5,HELLO,-99,40\r\n").unwrap();
    }
    autopilot.await_text("radio: 92 bytes, 0 reports: is it an AT modem?");
    running.stop();
}

/// What `gleaner check` prints about the reports when this datagram arrives on the radio's port.
fn checked(fixture: &Fixture, datagram: &[u8]) -> String {
    let held = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    // Frees the numbers for the process, which prints when it listens.
    let [autopilot, radio] = held.map(|socket| socket.local_addr().unwrap());
    let mut gleaner = fixture.gleaner("check");
    gleaner.args(["--wait", "30", "--autopilot", &format!("udpin:{autopilot}")]);
    gleaner.args(["--radio", &format!("udpin:{radio}")]);
    let mut child = gleaner.stdout(Stdio::piped()).spawn().unwrap();
    let mut reports = None;
    for line in BufReader::new(child.stdout.take().unwrap()).lines() {
        let line = line.unwrap();
        if line.starts_with("ok    autopilot") {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.send_to(datagram, radio).unwrap();
            socket.connect(autopilot).unwrap();
            FakeAutopilot::over(socket).send_state();
        }
        if line.contains(" reports   ") {
            reports = Some(line);
        }
    }
    child.wait().unwrap();
    reports.expect("a finding about the reports")
}

#[test]
fn the_check_listens_on_the_radio() {
    let json = b"{\"id\":1,\"snr_db\":6.5}\n";
    assert_eq!(
        checked(&Fixture::new(), json),
        "warn  reports    22 bytes, 0 reports: looks like JSON; write radio_format = \"json_lines\""
    );
    let fixture = with("radio_format = \"json_lines\"");
    assert_eq!(checked(&fixture, json), "ok    reports    22 bytes, 1 reports of 1 devices");
    let strange = b"{\"id\":77,\"snr_db\":6.5}\n";
    assert_eq!(
        checked(&fixture, strange),
        "warn  reports    23 bytes, 1 reports; not in the mission: 77: correct the ids"
    );
}

#[test]
fn without_a_radio_the_engage_request_waits() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.until(|_, message| matches!(message, gleaner_link::Message::Heartbeat(_)).then_some(()));
    autopilot.request(1.0);
    autopilot.await_text("gleaner: waiting: no byte from the radio");
    running.stop();
}
