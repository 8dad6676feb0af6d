//! The programs as a user runs them: size, start, memory, and the time of a sweep.

use super::golden::golden_packet;
use super::timing::Times;
use crate::programs::{path, repository};
use anyhow::{Result, bail, ensure};
use std::fmt::Write;
use std::fs;
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const PROGRAMS: [&str; 3] = ["gleaner", "gleaner-sitl", "gleaner-train"];
const STARTS: usize = 5;
const START_LIMIT: Duration = Duration::from_secs(20);
/// Time between two heartbeats of the simulated autopilot: how exactly the start is measured.
const BEAT: Duration = Duration::from_millis(2);
const SWEEP_FLIGHTS: u32 = 200;
/// `HEARTBEAT` of an ArduCopter in GUIDED, made by pymavlink.
const HEARTBEAT: &str = "heartbeat_copter_guided";

/// A program that ends with this value.
pub(super) struct Program(pub Child);

impl Drop for Program {
    fn drop(&mut self) {
        // Fails only when it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts `gleaner run`; returns the time to its first packet, microseconds, and its resident memory, MiB.
fn start(engine: &str, heartbeat: &[u8]) -> Result<(f64, f64)> {
    let folder = tempfile::tempdir()?;
    let socket = UdpSocket::bind("127.0.0.1:0")?;
    socket.set_read_timeout(Some(BEAT))?;
    let port = UdpSocket::bind("127.0.0.1:0")?.local_addr()?;
    let begin = Instant::now();
    let mut program = Program(
        Command::new(path("gleaner"))
            .args(["run", "--engine", engine, "--model", "models/gleaner.onnx"])
            .args(["--mission", "firmware/companion/dist/mission.toml"])
            .args(["--autopilot", &format!("udpin:{port}")])
            .arg("--log")
            .arg(folder.path().join("log"))
            .arg("--state")
            .arg(folder.path().join("state"))
            .current_dir(repository())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?,
    );
    let mut buffer = [0; 512];
    let took = loop {
        // Refused until the program listens.
        let _ = socket.send_to(heartbeat, port);
        match socket.recv_from(&mut buffer) {
            Ok((length, _)) if length > 0 => break begin.elapsed(),
            _ => {}
        }
        if program.0.try_wait()?.is_some() {
            let mut said = String::new();
            if let Some(mut error) = program.0.stderr.take() {
                std::io::Read::read_to_string(&mut error, &mut said)?;
            }
            bail!("gleaner run --engine {engine} ended: {said}");
        }
        ensure!(begin.elapsed() < START_LIMIT, "gleaner run --engine {engine} sends nothing");
    };
    let status = fs::read_to_string(format!("/proc/{}/status", program.0.id())).unwrap_or_default();
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kib: f64 = resident.and_then(|text| text.split_whitespace().next()?.parse().ok()).unwrap_or(f64::NAN);
    Ok((took.as_secs_f64() * 1e6, kib / 1024.0))
}

/// Sizes and start.
pub(super) fn programs(page: &mut String) -> Result<()> {
    writeln!(page, "## Programs\n\nSizes of the release build as it is, with line tables, and stripped.\n")?;
    writeln!(page, "| program | MB | stripped, MB |\n|---|---|---|")?;
    let folder = tempfile::tempdir()?;
    for name in PROGRAMS {
        let megabytes =
            |path: &std::path::Path| fs::metadata(path).map_or(f64::NAN, |file| file.len() as f64 / 1e6);
        let stripped = folder.path().join(name);
        let _ = Command::new("strip").arg("-o").arg(&stripped).arg(path(name)).status();
        writeln!(page, "| `{name}` | {:.1} | {:.1} |", megabytes(&path(name)), megabytes(&stripped))?;
    }
    let heartbeat = golden_packet(HEARTBEAT)?;
    writeln!(
        page,
        "\nFrom the start of `gleaner run` to its first packet on a UDP port, with an autopilot that sends a heartbeat \
         every {} ms.\n\n| engine | time | resident memory, MiB |\n|---|---|---|",
        BEAT.as_millis()
    )?;
    for engine in ["native", "tract"] {
        let starts: Vec<(f64, f64)> =
            (0..STARTS).map(|_| start(engine, &heartbeat)).collect::<Result<_>>()?;
        let memory = starts.iter().map(|(_, memory)| *memory).fold(0.0, f64::max);
        let times = Times::from_micros(starts.iter().map(|(took, _)| took / 1e3).collect());
        writeln!(
            page,
            "| {engine} | {:.0} ms (minimum {:.0}) | {memory:.1} |",
            times.median(),
            times.minimum()
        )?;
    }
    Ok(())
}

/// Time of a sweep of faulted flights.
pub(super) fn sweep(page: &mut String) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let begin = Instant::now();
    let output = Command::new(path("gleaner-sitl"))
        .args(["sweep", "--flights", &SWEEP_FLIGHTS.to_string(), "--jobs", "1"])
        .arg("--out")
        .arg(folder.path())
        .current_dir(repository())
        .output()?;
    ensure!(output.status.success(), "the sweep failed: {}", String::from_utf8_lossy(&output.stderr));
    let wall_s = begin.elapsed().as_secs_f64();
    writeln!(
        page,
        "## Sweep\n\n`gleaner-sitl sweep --flights {SWEEP_FLIGHTS} --jobs 1`: {wall_s:.1} s, {:.1} s per 1,000 faulted \
         flights on one core.",
        wall_s * 1000.0 / f64::from(SWEEP_FLIGHTS)
    )?;
    Ok(())
}
