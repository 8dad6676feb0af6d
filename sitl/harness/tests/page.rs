//! `gleaner-sitl serve --http` and `fly --html` as a user runs them: what a viewer gets, and what a command does.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

/// Killed when a test fails.
struct Served {
    child: Child,
    address: String,
    /// Open to the end: the program ends when it cannot print.
    _output: BufReader<ChildStdout>,
}

impl Drop for Served {
    fn drop(&mut self) {
        // Fails when it has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Served {
    fn start(out: &std::path::Path, more: &[&str]) -> Served {
        let mut child = Command::new(env!("CARGO_BIN_EXE_gleaner-sitl"))
            .args(["serve", "--auto-takeoff", "--seed", "3", "--speed", "20", "--http", "127.0.0.1:0"])
            .args(["--gcs", "udpin:127.0.0.1:0", "--out"])
            .arg(out)
            .args(more)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let mut lines = output.by_ref().lines().map(|line| line.unwrap());
        let page = lines.find_map(|line| line.strip_prefix("page http://").map(str::to_owned));
        let address = page.expect("the page's address").trim_end_matches('/').to_owned();
        Served { child, address, _output: output }
    }

    fn ask(&self, request: &str, body: &str) -> BufReader<TcpStream> {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let (address, length) = (&self.address, body.len());
        write!(
            stream,
            "{request} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nContent-Type: application/json\r\n\
             Content-Length: {length}\r\n\r\n{body}"
        )
        .unwrap();
        BufReader::new(stream)
    }

    /// The answer to a command of the page.
    fn command(&self, body: &str) -> String {
        let mut answer = String::new();
        self.ask("POST /api/command", body).read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        answer
    }
}

/// Reads events of this kind until one satisfies `wanted`.
fn until(
    stream: &mut BufReader<TcpStream>,
    kind: &str,
    mut wanted: impl FnMut(&serde_json::Value) -> bool,
) -> serde_json::Value {
    loop {
        let mut line = String::new();
        assert_ne!(stream.read_line(&mut line).unwrap(), 0, "the stream ended");
        if line.trim_end() != format!("event: {kind}") {
            continue;
        }
        line.clear();
        stream.read_line(&mut line).unwrap();
        let value = serde_json::from_str(line.strip_prefix("data: ").unwrap()).unwrap();
        if wanted(&value) {
            return value;
        }
    }
}

#[test]
fn a_command_of_the_page_flies_the_simulated_aircraft() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), &["--onboard", "--grid-rotation", "30"]);
    let mut stream = served.ask("GET /api/events", "");
    let flight = until(&mut stream, "flight", |_| true);
    assert_eq!(flight["scene"]["grid"]["rotation_deg"], 30.0);
    assert_eq!(flight["scene"]["sight"].as_array().unwrap().len(), 6);
    until(&mut stream, "live", |live| live["height_m"].as_f64().is_some_and(|height_m| height_m > 59.0));
    assert!(served.command(r#"{"preference":0.25}"#).contains("acknowledged: accepted"));
    assert!(served.command(r#"{"request":"engage"}"#).contains("acknowledged: accepted"));
    let live = until(&mut stream, "live", |live| live["state"] == "engaged");
    assert_eq!(
        (live["w_data"].as_f64(), live["owner"].as_str()),
        (Some(0.25), Some("Gleaner flies the mission"))
    );
    let decision = until(&mut stream, "decision", |decision| decision["sequence"] == 1);
    let sum: f64 =
        decision["probabilities"].as_array().unwrap().iter().map(|share| share.as_f64().unwrap()).sum();
    assert!((sum - 1.0).abs() < 0.01, "{decision}");
    assert_eq!(decision["attention"].as_array().unwrap().len(), 3 + 6);
    let forecast = until(&mut stream, "what_if", |_| true);
    assert_eq!(forecast["options"].as_array().unwrap().len(), 5);
    assert!(served.command(r#"{"incident":"pilot takes LOITER"}"#).contains("done: the pilot selects"));
    let taken = until(&mut stream, "live", |live| live["state"] == "passive");
    assert!(taken["reason"].as_str().unwrap().starts_with("Taken over: "), "{taken}");
    assert!(served.command(r#"{"incident":"volcano"}"#).contains("no such incident"));
}

#[test]
fn the_page_of_an_outside_pilot_is_served_before_it_connects() {
    let folder = tempfile::tempdir().unwrap();
    let served =
        Served::start(folder.path(), &["--companion", "tcpin:127.0.0.1:0", "--radio", "tcpin:127.0.0.1:0"]);
    let mut stream = served.ask("GET /api/events", "");
    let live = until(&mut stream, "live", |live| live["mode"] == "GUIDED");
    assert_eq!(live["state"], "not heard");
    assert!(live["x"].as_f64().is_some(), "{live}");
    assert!(served.command(r#"{"request":"engage"}"#).contains("not acknowledged"));
}

#[test]
fn a_flight_is_written_as_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("flight.html");
    let flown = Command::new(env!("CARGO_BIN_EXE_gleaner-sitl"))
        .args(["fly", "--seed", "1", "--preference", "0.9", "--json", "--out"])
        .arg(folder.path())
        .arg("--html")
        .arg(&file)
        .output()
        .unwrap();
    let figures: serde_json::Value = serde_json::from_slice(&flown.stdout).unwrap();
    let page = std::fs::read_to_string(file).unwrap();
    assert!(page.len() < 500_000, "{} bytes", page.len());
    let start = page.find(r#"id="flight">"#).unwrap() + r#"id="flight">"#.len();
    let end = start + page[start..].find("</script>").unwrap();
    let flight: serde_json::Value = serde_json::from_str(&page[start..end]).unwrap();
    let list = |name: &str| flight[name].as_array().unwrap();
    assert_eq!(list("decisions").len() as u64, figures["decisions"].as_u64().unwrap());
    assert!(list("decisions").iter().all(|decision| decision["attention"].is_array()), "all are explained");
    let last = list("live").last().unwrap();
    let collected = last["collected"].as_f64().unwrap();
    assert!((collected - figures["collected"].as_f64().unwrap()).abs() < 0.02, "{last}");
    assert_eq!(last["state"], "done");
    assert!(list("what_if").len() > 5 && list("texts").len() > 3);
}
