//! Latency of `gleaner run`: from the last byte of a heartbeat or a radio report to the first byte of a position target.

use super::programs::Program;
use super::timing::Times;
use crate::programs::{path, repository};
use anyhow::{Context, Result, bail, ensure};
use gleaner_link::{Address, FrameDecoder, Packet, TUNNEL_RADIO_REPORT};
use gleaner_radio::{Report, encode_body};
use gleaner_units::Db;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fmt::Write;
use std::net::UdpSocket;
use std::os::fd::OwnedFd;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Starts of the program on each line: each gives one time of a report and [`TAKE_OVERS`] of the others.
const STARTS: u32 = 5;
const TAKE_OVERS: u32 = 8;
const AUTOPILOT: Address = Address { system: 1, component: 1 };
const STATION: Address = Address { system: 255, component: 190 };
const GLEANER: u8 = 191;
/// Modes of ArduCopter.
const GUIDED: u32 = 4;
const LOITER: u32 = 5;
/// The rates of the autopilot's streams.
const STATE_PERIOD: Duration = Duration::from_millis(100);
const HEARTBEAT_PERIOD: Duration = Duration::from_secs(1);
const PATIENCE: Duration = Duration::from_secs(20);

/// An armed ArduCopter over the example mission, and a ground station behind it.
struct Vehicle {
    line: OwnedFd,
    decoder: FrameDecoder,
    sequence: u8,
    mode: u32,
    state_at: Option<Instant>,
    heartbeat_at: Option<Instant>,
}

impl Vehicle {
    fn new(line: OwnedFd) -> Vehicle {
        let decoder = FrameDecoder::new();
        Vehicle { line, decoder, sequence: 0, mode: GUIDED, state_at: None, heartbeat_at: None }
    }

    fn write(&mut self, frame: &[u8]) {
        // Refused until the program listens.
        let _ = rustix::io::write(&self.line, frame);
        self.sequence = self.sequence.wrapping_add(1);
    }

    fn send(&mut self, sender: Address, message: &impl MessageData) -> Result<()> {
        let packet = Packet::new(message).context("a message is too long")?;
        let frame = packet.frame(sender, self.sequence);
        self.write(&frame);
        Ok(())
    }

    /// A heartbeat in this mode; returns when its last byte was written.
    fn heartbeat(&mut self, mode: u32) -> Result<Instant> {
        self.mode = mode;
        self.send(
            AUTOPILOT,
            &HEARTBEAT_DATA {
                custom_mode: mode,
                mavtype: MavType::MAV_TYPE_QUADROTOR,
                autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                base_mode: MavModeFlag::from_bits_truncate(0xD9),
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            },
        )?;
        let now = Instant::now();
        self.heartbeat_at = Some(now);
        Ok(now)
    }

    fn state(&mut self) -> Result<()> {
        let (latitude, longitude, altitude) = (-353_632_621, 1_491_652_374, 600_000);
        let origin =
            GPS_GLOBAL_ORIGIN_DATA { latitude, longitude, altitude, ..GPS_GLOBAL_ORIGIN_DATA::DEFAULT };
        let home = HOME_POSITION_DATA { latitude, longitude, altitude, ..HOME_POSITION_DATA::DEFAULT };
        let flags = EkfStatusFlags::from_bits_truncate(0x33F);
        let position =
            LOCAL_POSITION_NED_DATA { x: 190.0, y: 590.0, z: -60.0, ..LOCAL_POSITION_NED_DATA::DEFAULT };
        self.send(AUTOPILOT, &origin)?;
        self.send(AUTOPILOT, &home)?;
        self.send(AUTOPILOT, &EKF_STATUS_REPORT_DATA { flags, ..EKF_STATUS_REPORT_DATA::DEFAULT })?;
        self.send(AUTOPILOT, &position)?;
        self.send(AUTOPILOT, &BATTERY_STATUS_DATA { battery_remaining: 90, ..BATTERY_STATUS_DATA::DEFAULT })
    }

    /// A report of a device through the autopilot; returns when its last byte was written.
    fn report(&mut self) -> Instant {
        let body = encode_body(&Report { device: 1, snr: Db(2.5), remaining: None, age_ms: 0 });
        let [low, high] = TUNNEL_RADIO_REPORT.to_le_bytes();
        let mut payload = vec![low, high, AUTOPILOT.system, GLEANER, body.len() as u8];
        payload.extend_from_slice(&body);
        if let Some(packet) = Packet::from_payload(TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC, &payload) {
            let frame = packet.frame(AUTOPILOT, self.sequence);
            self.write(&frame);
        }
        Instant::now()
    }

    /// Ids of the messages that arrive within a millisecond, while the streams go on.
    fn exchange(&mut self) -> Result<Vec<u32>> {
        let is_due = |at: Option<Instant>, period| at.is_none_or(|at| at.elapsed() >= period);
        if is_due(self.heartbeat_at, HEARTBEAT_PERIOD) {
            self.heartbeat(self.mode)?;
        }
        if is_due(self.state_at, STATE_PERIOD) {
            self.state_at = Some(Instant::now());
            self.state()?;
        }
        let timeout = Timespec { tv_sec: 0, tv_nsec: 1_000_000 };
        poll(&mut [PollFd::new(&self.line, PollFlags::IN)], Some(&timeout))?;
        let (mut buffer, mut ids) = ([0; 2048], Vec::new());
        let Ok(length) = rustix::io::read(&self.line, &mut buffer) else { return Ok(ids) };
        let mut bytes = &buffer[..length];
        while let Some(frame) = self.decoder.read(&mut bytes) {
            ids.push(frame.message_id);
        }
        Ok(ids)
    }

    /// Waits for a message of Gleaner; when it arrived.
    fn await_message(&mut self, id: u32) -> Result<Instant> {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE {
            if self.exchange()?.contains(&id) {
                return Ok(Instant::now());
            }
        }
        bail!("no message {id} in {} s", PATIENCE.as_secs())
    }

    /// Waits for this long; when the last position target arrived.
    fn last_target(&mut self, lasts: Duration) -> Result<Option<Instant>> {
        let (begun, mut last) = (Instant::now(), None);
        while begun.elapsed() < lasts {
            if self.exchange()?.contains(&SET_POSITION_TARGET_LOCAL_NED_DATA::ID) {
                last = Some(Instant::now());
            }
        }
        Ok(last)
    }

    /// `MAV_CMD_USER_2`: 0 off, 1 engage.
    fn request(&mut self, param1: f32) -> Result<()> {
        self.send(
            STATION,
            &COMMAND_LONG_DATA {
                target_system: AUTOPILOT.system,
                target_component: GLEANER,
                command: MavCmd::MAV_CMD_USER_2,
                param1,
                ..COMMAND_LONG_DATA::DEFAULT
            },
        )?;
        self.await_message(COMMAND_ACK_DATA::ID).map(drop)
    }
}

fn pilot(endpoint: &str) -> Result<Program> {
    let words = ["run", "--mission", "firmware/companion/dist/mission.toml", "--autopilot", endpoint];
    let mut command = Command::new(path("gleaner"));
    command.args(words).current_dir(repository()).stdout(Stdio::null()).stderr(Stdio::null());
    Ok(Program(command.spawn()?))
}

/// Starts a pilot with a vehicle on its line.
type Connect = fn() -> Result<(Program, Vehicle)>;

fn over_udp() -> Result<(Program, Vehicle)> {
    let free = UdpSocket::bind("127.0.0.1:0")?.local_addr()?;
    let socket = UdpSocket::bind("127.0.0.1:0")?;
    socket.connect(free)?;
    socket.set_nonblocking(true)?;
    Ok((pilot(&format!("udpin:{free}"))?, Vehicle::new(socket.into())))
}

fn over_terminal() -> Result<(Program, Vehicle)> {
    let far = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&far)?;
    unlockpt(&far)?;
    rustix::fs::fcntl_setfl(&far, OFlags::NONBLOCK)?;
    let name = ptsname(&far, Vec::new())?;
    let endpoint = format!("serial:{}:921600", name.to_str()?);
    Ok((pilot(&endpoint)?, Vehicle::new(far)))
}

/// Times in microseconds: report to target, heartbeat to target, and heartbeat of a take-over to the last target.
fn measure(connect: Connect) -> Result<[Vec<f64>; 3]> {
    let mut times = [const { Vec::new() }; 3];
    let micros = |from: Instant, to: Instant| to.saturating_duration_since(from).as_secs_f64() * 1e6;
    for start in 0..STARTS {
        let (_pilot, mut vehicle) = connect()?;
        vehicle.await_message(HEARTBEAT_DATA::ID)?;
        vehicle.last_target(Duration::from_secs(1))?;
        vehicle.request(1.0)?;
        let early = vehicle.last_target(Duration::from_millis(1_000 + 7 * u64::from(start)))?;
        ensure!(early.is_none(), "a target without a radio");
        let reported = vehicle.report();
        times[0].push(micros(reported, vehicle.await_message(SET_POSITION_TARGET_LOCAL_NED_DATA::ID)?));
        for number in 0..TAKE_OVERS {
            let taken = vehicle.heartbeat(LOITER)?;
            let last = vehicle.last_target(Duration::from_millis(500))?;
            times[2].push(last.map_or(0.0, |last| micros(taken, last)));
            vehicle.report();
            // An equal request shortly after the first would count as its retransmission.
            vehicle.request(0.0)?;
            vehicle.request(1.0)?;
            let early = vehicle.last_target(Duration::from_millis(200 + 11 * u64::from(number)))?;
            ensure!(early.is_none(), "a target in LOITER");
            let given = vehicle.heartbeat(GUIDED)?;
            times[1].push(micros(given, vehicle.await_message(SET_POSITION_TARGET_LOCAL_NED_DATA::ID)?));
        }
    }
    Ok(times)
}

/// The distributions on both lines.
pub(super) fn latency(page: &mut String) -> Result<()> {
    writeln!(
        page,
        "## Latency\n\n`gleaner run` with look-ahead as a process of its own. It reads its ports at once and decides every \
         20 ms, so that an answer is up to 20 ms and its own time late. A pty has no baud rate: at 921,600 \
         baud a heartbeat takes 0.2 ms more. The last row counts targets that left before the heartbeat was read as 0.\n\n\
         | line | from the last byte of | to | median | 90 % | longest |\n|---|---|---|---|---|---|"
    )?;
    let events = [
        ("the first radio report", "the first target"),
        ("the heartbeat that gives control", "the first target"),
        ("the heartbeat that takes control", "the last target"),
    ];
    let lines: [(&str, Connect); 2] = [("UDP, loopback", over_udp), ("serial, pty", over_terminal)];
    for (line, connect) in lines {
        for ((from, to), times) in events.into_iter().zip(measure(connect)?) {
            let times = Times::from_micros(times);
            let text = |micros: f64| format!("{:.1} ms", micros / 1e3);
            let [median, high, longest] = [0.5, 0.9, 1.0].map(|at| text(times.quantile(at)));
            writeln!(page, "| {line} | {from} | {to} | {median} | {high} | {longest} |")?;
        }
    }
    Ok(())
}
