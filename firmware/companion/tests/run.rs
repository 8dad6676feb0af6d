//! `gleaner run` as a process, with this test as its autopilot and its radio. Nothing sleeps: each wait is for
//! bytes or for a line on stderr.

mod fixture;

use fixture::{Fixture, LOGITS};
use gleaner_link::{Address, FrameDecoder, Message, Packet, TUNNEL_DECISION};
use gleaner_policy::LOCAL_MAP_CELLS;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, UdpSocket};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::Duration;

const AUTOPILOT: Address = Address::new(7, 1);
const GLEANER: Address = Address::new(7, 191);

/// Killed when a test fails.
struct Process(Child);

/// The process, and what it says.
struct Running {
    process: Process,
    stderr: BufReader<ChildStderr>,
}

impl Running {
    fn start(gleaner: &mut Command) -> Running {
        let mut child = gleaner.stderr(Stdio::piped()).spawn().unwrap();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        Running { process: Process(child), stderr }
    }

    /// Reads stderr up to a line that contains `part`.
    #[track_caller]
    fn says(&mut self, part: &str) -> String {
        let mut so_far = String::new();
        loop {
            let start = so_far.len();
            assert_ne!(self.stderr.read_line(&mut so_far).unwrap(), 0, "it ended without {part:?}: {so_far}");
            if so_far[start..].contains(part) {
                return so_far[start..].trim_end().to_owned();
            }
        }
    }

    /// Asks it to end; its exit code and what it said until then.
    fn stop(self) -> (Option<i32>, String) {
        self.stop_by("TERM")
    }

    fn stop_by(mut self, name: &str) -> (Option<i32>, String) {
        self.process.signal(name);
        let mut rest = String::new();
        while self.stderr.read_line(&mut rest).unwrap() > 0 {}
        (self.process.0.wait().unwrap().code(), rest)
    }
}

impl Process {
    fn signal(&self, name: &str) {
        let kill = format!("kill -{name} {}", self.0.id());
        assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Fails when it has ended already, as it should.
        let _ = self.0.kill();
    }
}

/// What an ArduCopter says.
struct FakeAutopilot {
    socket: UdpSocket,
    decoder: FrameDecoder,
    sequence: u8,
}

impl FakeAutopilot {
    /// Connects to where the process says that it listens.
    fn find(running: &mut Running) -> FakeAutopilot {
        FakeAutopilot::at(&running.says("local address "))
    }

    /// Connects to the address at the end of the line.
    fn at(line: &str) -> FakeAutopilot {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(line.split("local address ").last().unwrap()).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
        FakeAutopilot { socket, decoder: FrameDecoder::new(), sequence: 0 }
    }

    fn send(&mut self, message: &impl MessageData) {
        self.send_as(AUTOPILOT, message);
    }

    fn send_as(&mut self, sender: Address, message: &impl MessageData) {
        self.sequence = self.sequence.wrapping_add(1);
        let frame = Packet::new(message).unwrap().frame(sender, self.sequence);
        self.socket.send(&frame).unwrap();
    }

    /// Armed in GUIDED, 60 m over the centre of cell (1, 0), with half of its battery.
    fn send_state(&mut self) {
        self.send(&HEARTBEAT_DATA {
            custom_mode: 4,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode: MavModeFlag::from_bits_truncate(0xD9),
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        });
        self.send(&GPS_GLOBAL_ORIGIN_DATA {
            latitude: -353_632_621,
            longitude: 1_491_652_374,
            altitude: 600_000,
            ..GPS_GLOBAL_ORIGIN_DATA::DEFAULT
        });
        self.send(&HOME_POSITION_DATA {
            latitude: -353_632_621,
            longitude: 1_491_652_374,
            altitude: 600_000,
            ..HOME_POSITION_DATA::DEFAULT
        });
        self.send(&EKF_STATUS_REPORT_DATA {
            flags: EkfStatusFlags::from_bits_truncate(0x33F),
            ..EKF_STATUS_REPORT_DATA::DEFAULT
        });
        self.send(&LOCAL_POSITION_NED_DATA {
            x: 10.0,
            y: 30.0,
            z: -60.0,
            ..LOCAL_POSITION_NED_DATA::DEFAULT
        });
        self.send(&BATTERY_STATUS_DATA { battery_remaining: 50, ..BATTERY_STATUS_DATA::DEFAULT });
    }

    /// Repeats the autopilot's state until `wanted` is answered. Sends garbage in between.
    fn until<T>(&mut self, mut wanted: impl FnMut(Address, &Message) -> Option<T>) -> T {
        for round in 0..100u8 {
            self.send_state();
            self.socket.send(&[0xFD, round, 0, 0, 1, 2, 3, 0xFE, 0xFF, round]).unwrap();
            if let Some(answer) = self.drain(&mut wanted) {
                return answer;
            }
        }
        panic!("it never came");
    }

    /// Reads until nothing comes for a while.
    fn drain<T>(&mut self, mut wanted: impl FnMut(Address, &Message) -> Option<T>) -> Option<T> {
        let mut buffer = [0; 2048];
        while let Ok(bytes) = self.socket.recv(&mut buffer) {
            let datagram = &buffer[..bytes];
            assert_eq!(self.decoder.push(datagram), bytes);
            let (mut whole, mut answer) = (0, None);
            while let Some(frame) = self.decoder.next_frame() {
                whole += frame.payload().len() + 12;
                let message = Message::decode(&frame).unwrap();
                answer = answer.or(message.and_then(|message| wanted(frame.sender, &message)));
            }
            assert_eq!(whole, bytes, "whole frames in each datagram: {datagram:02x?}");
            if answer.is_some() {
                return answer;
            }
        }
        None
    }

    fn ask_for_shadow(&mut self) {
        let shadow = COMMAND_LONG_DATA {
            target_system: GLEANER.system,
            target_component: GLEANER.component,
            command: MavCmd::MAV_CMD_USER_2,
            param1: 2.0,
            ..COMMAND_LONG_DATA::DEFAULT
        };
        // A ground station, by way of the autopilot's port.
        self.send_as(Address::new(255, 190), &shadow);
    }

    /// Goes on until a decision record comes.
    fn await_decision(&mut self) {
        self.until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
        self.ask_for_shadow();
        self.until(|_, message| match message {
            Message::Tunnel { payload_type: TUNNEL_DECISION, .. } => Some(()),
            _ => None,
        });
    }
}

#[test]
fn it_speaks_as_a_component_of_the_vehicle_and_ends_on_an_interrupt() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    let (sender, heartbeat) = autopilot.until(|sender, message| match message {
        Message::Heartbeat(heartbeat) => Some((sender, *heartbeat)),
        _ => None,
    });
    assert_eq!(sender, GLEANER, "the autopilot's system id is adopted");
    assert_eq!((heartbeat.vehicle, heartbeat.autopilot), (18, 8));
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert!(rest.contains("stopped after 0 decisions: setpoints and heartbeat have ended"), "{rest}");
    assert!(!rest.contains("panicked"), "{rest}");
    let goodbye = autopilot.drain(|_, message| match message {
        Message::StatusText { text, .. } if text.starts_with(b"gleaner: stopped") => Some(()),
        _ => None,
    });
    assert!(goodbye.is_some(), "the operator was told");
}

#[test]
fn every_decision_is_logged_whole() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.await_decision();
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    let text = std::fs::read_to_string(fixture.path("log/decisions.jsonl")).unwrap();
    let first: serde_json::Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    assert_eq!(first["state"], "shadow");
    assert_eq!(first["cell"], serde_json::json!([1, 0]));
    assert_eq!(first["action"], "hover");
    assert_eq!(first["mask"].as_array().unwrap()[0], "hover");
    assert_eq!(first["battery"], 20.0);
    assert_eq!(first["logits"], serde_json::json!(LOGITS));
    assert_eq!(first["w_data"], 0.25);
    // Spare battery, battery, terminal 2 cells east and 2 north.
    assert_eq!(first["tokens"]["uav"], serde_json::json!([16.0, 20.0, 40.0, 40.0]));
    assert_eq!(first["tokens"]["local_map"].as_array().unwrap().len(), LOCAL_MAP_CELLS);
    // One cell east and one north; a building hides it from the cell to the north, so the vantage is the one to the east.
    assert_eq!(first["tokens"]["devices"], serde_json::json!([[20.0, 20.0, 6000.0, -34.0, 0.0, 20.0, 0.0]]));
    assert_eq!(first["slots"], serde_json::json!([0]));
    assert!(first["infer_us"].is_u64() && first["run_s"].is_u64() && first["time_us"].is_u64(), "{first}");
}

#[test]
fn a_full_disk_is_said_once_and_the_flight_goes_on() {
    let fixture = Fixture::new();
    std::fs::create_dir(fixture.path("log")).unwrap();
    std::os::unix::fs::symlink("/dev/full", fixture.path("log/decisions.jsonl")).unwrap();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.await_decision();
    autopilot.until(|_, message| match message {
        Message::Tunnel { payload_type: TUNNEL_DECISION, .. } => Some(()),
        _ => None,
    });
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert_eq!(rest.matches("make room on the disk; flying on without the log").count(), 1, "{rest}");
    assert!(rest.contains("decisions were not written"), "{rest}");
}

/// Who reads the messages must not decide over the flight: a log nobody takes any more, and a terminal that is held.
#[test]
fn messages_that_nobody_takes_do_not_end_the_flight_nor_hold_it() {
    for is_held in [false, true] {
        let fixture = Fixture::new();
        let (messages, stderr) = std::io::pipe().unwrap();
        let child = fixture.gleaner("run").env("RUST_LOG", "trace").stderr(stderr).spawn().unwrap();
        let mut process = Process(child);
        let mut messages = BufReader::new(messages);
        let mut line = String::new();
        while !line.contains("local address ") {
            line.clear();
            assert_ne!(messages.read_line(&mut line).unwrap(), 0, "it ended");
        }
        let mut autopilot = FakeAutopilot::at(line.trim_end());
        let _held = if is_held {
            fill(messages.get_ref());
            Some(messages)
        } else {
            drop(messages);
            None
        };
        autopilot.await_decision();
        process.signal("TERM");
        assert_eq!(process.0.wait().unwrap().code(), Some(0), "held: {is_held}");
    }
}

/// Fills the pipe that ends here, so that one more byte would wait.
fn fill(pipe: &std::io::PipeReader) {
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::OpenOptionsExt;
    let nonblocking = rustix::fs::OFlags::NONBLOCK.bits() as i32;
    let mut options = std::fs::OpenOptions::new();
    options.write(true).custom_flags(nonblocking);
    let mut pipe = options.open(format!("/proc/self/fd/{}", pipe.as_raw_fd())).unwrap();
    while pipe.write(b".").is_ok() {}
}

#[test]
fn a_closed_terminal_ends_the_run_unless_hangups_are_ignored() {
    let fixture = Fixture::new();
    let mut running = Running::start(&mut fixture.gleaner("run"));
    FakeAutopilot::find(&mut running)
        .until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    let (code, rest) = running.stop_by("HUP");
    assert_eq!(code, Some(0), "{rest}");

    let gleaner = fixture.gleaner("run");
    let mut ignoring = Command::new("sh");
    ignoring
        .args(["-c", "trap '' HUP; exec \"$@\"", "sh"])
        .arg(gleaner.get_program())
        .args(gleaner.get_args());
    let mut running = Running::start(&mut ignoring);
    let mut autopilot = FakeAutopilot::find(&mut running);
    running.process.signal("HUP");
    autopilot.await_decision();
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert!(!rest.contains("stopped after 0 decisions"), "{rest}");
}

#[test]
fn a_radio_that_disappears_is_said_once_and_taken_back() {
    let fixture = Fixture::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let radio = format!("tcpout:{}", listener.local_addr().unwrap());
    let mut running = Running::start(fixture.gleaner("run").args(["--radio", &radio]));
    let mut autopilot = FakeAutopilot::find(&mut running);
    autopilot.until(|_, message| matches!(message, Message::Heartbeat(_)).then_some(()));
    drop(listener.accept().unwrap());
    let mut told = |text: &[u8]| {
        autopilot.until(|_, message| match message {
            Message::StatusText { text: line, .. } if line.starts_with(text) => Some(()),
            _ => None,
        });
    };
    told(b"gleaner: radio port down, retrying");
    let again = listener.accept().unwrap();
    told(b"gleaner: radio port is back");
    let (code, rest) = running.stop();
    assert_eq!(code, Some(0), "{rest}");
    assert_eq!(rest.matches(&format!("radio port {radio} is down: ")).count(), 1, "{rest}");
    assert_eq!(rest.matches(&format!("radio port {radio} is back")).count(), 1, "{rest}");
    drop(again);
}

#[test]
fn check_hears_the_autopilot() {
    let fixture = Fixture::new();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let own = socket.local_addr().unwrap();
    // Frees the number for the process, which says when it listens.
    drop(socket);
    let mut child = fixture
        .gleaner("check")
        .args(["--wait", "30", "--autopilot", &format!("udpin:{own}")])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let stdout = BufReader::new(child.stdout.take().unwrap());
    let mut heard = None;
    for line in stdout.lines() {
        let line = line.unwrap();
        if line.starts_with("ok    autopilot") {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.connect(own).unwrap();
            let decoder = FrameDecoder::new();
            FakeAutopilot { socket, decoder, sequence: 0 }.send_state();
        }
        if line.contains("heartbeat") {
            heard = Some(line);
        }
    }
    assert_eq!(heard.as_deref(), Some("ok    heartbeat  ArduPilot, system id 7"));
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
