//! The page of `gleaner run`, the page of a finished run, and a mission as a page.

mod fixture;

use fixture::vehicle::{FakeAutopilot, Running};
use fixture::{Fixture, outcome};
use gleaner_link::Message;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// The answer to a request; reading fails instead of waiting for ever.
fn ask(address: &str, request: &str, headers: &str, body: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let length = body.len();
    write!(
        stream,
        "{request} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nContent-Type: application/json\r\n\
         Content-Length: {length}\r\n{headers}\r\n{body}"
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn the_page_commands_like_a_ground_station() {
    let fixture = Fixture::new();
    let mut running = Running::start(fixture.gleaner("run").args(["--http", "0"]));
    let mut autopilot = FakeAutopilot::find(&mut running);
    let line = running.says("page http://");
    let address = line.split("http://").last().unwrap().trim_end_matches('/');
    autopilot.until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    let answer = ask(address, "POST /api/command", "", r#"{"preference":0.75}"#);
    assert!(answer.contains("acknowledged: accepted"), "{answer}");
    autopilot.await_text("gleaner: preference w_data 0.75");
    let answer =
        ask(address, "POST /api/command", "Origin: http://evil.example\r\n", r#"{"request":"engage"}"#);
    assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert!(!rest.contains("panicked"), "{rest}");
}

#[test]
fn an_open_page_needs_the_tokens_of_the_configuration() {
    let fixture = Fixture::new();
    let page = "log_dir = \"log\"\n[page]\nhttp = \"0.0.0.0:0\"\nview_token = \"view-0123456789abcdef\"\n\
                control_token = \"control-0123456789abcdef\"\n";
    fixture.edit("gleaner.toml", "log_dir = \"log\"\n", page);
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let line = running.says("page at http://");
    assert!(!line.contains("0123456789abcdef"), "tokens of the configuration stay there: {line}");
    let port = line.split("0.0.0.0:").last().unwrap().split('/').next().unwrap();
    let address = format!("127.0.0.1:{port}");
    let command = r#"{"request":"return"}"#;
    let with = |token: &str| {
        ask(&address, "POST /api/command", &format!("Authorization: Bearer {token}\r\n"), command)
    };
    assert!(ask(&address, "POST /api/command", "", command).starts_with("HTTP/1.1 401"));
    assert!(with("view-0123456789abcdef").starts_with("HTTP/1.1 403"));
    // No autopilot is there, so no pilot answers; the command was taken.
    assert!(with("control-0123456789abcdef").contains("acknowledged"));
    assert_eq!(running.stop().0, Some(0));
}

#[test]
fn a_page_whose_operator_is_left_out_is_refused() {
    let fixture = Fixture::new();
    fixture.edit("gleaner.toml", "log_dir = \"log\"\n", "log_dir = \"log\"\noperators = [\"7\"]\n");
    let (code, _, error) = outcome(&fixture.gleaner("run").args(["--http", "0"]).output().unwrap());
    assert_eq!(code, Some(2));
    assert!(error.contains("add \"255/25\" there"), "{error}");
}

#[test]
fn a_run_becomes_a_page_and_so_does_its_mission() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.await_decision();
    autopilot.await_text("gleaner: shadow, commanding nothing");
    assert_eq!(running.stop().0, Some(0));
    let at = |name: &str| fixture.path(name);
    let gleaner = || std::process::Command::new(env!("CARGO_BIN_EXE_gleaner"));
    let (code, said, error) = outcome(
        &gleaner()
            .arg("report")
            .arg(at("log"))
            .args(["--model".as_ref(), at("policy.onnx").as_os_str()])
            .args(["--html".as_ref(), at("flight.html").as_os_str()])
            .output()
            .unwrap(),
    );
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("decisions   ") && !said.contains("telemetry   0"), "{said}");
    let page = std::fs::read_to_string(at("flight.html")).unwrap();
    assert!(page.contains("shadow, commanding nothing"), "texts come from the telemetry");
    assert!(page.contains(r#""probabilities":["#) && page.contains(r#""attention":[["#));
    // The mission stands beside the log.
    std::fs::remove_file(at("log/mission.bin")).unwrap();
    let (code, _, error) = outcome(&gleaner().arg("report").arg(at("log")).output().unwrap());
    assert_eq!((code, error.lines().count()), (Some(2), 1), "{error}");
    assert!(error.contains("mission.bin: is no mission of a flight: give the mission file"), "{error}");
    let (code, said, error) = outcome(
        &gleaner()
            .args(["mission", "show"])
            .arg(at("mission.toml"))
            .args(["--html".as_ref(), at("mission.html").as_os_str()])
            .output()
            .unwrap(),
    );
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("fence       12 of 12 cells"), "{said}");
    assert!(std::fs::read_to_string(at("mission.html")).unwrap().contains(r#""sight":[""#));
}
