//! `gleaner run` in flight, beside a simulated city in real time.

use super::peer::Peer;
use crate::python;
use crate::serving::{Link, Serving};
use anyhow::{Context, Result};
use std::fmt::Write;
use std::fs;

/// Decisions of the measured part of the flight. Hovering and flying, one takes two to six seconds.
const DECISIONS: u32 = 12;
/// `USER_HZ`, the unit of CPU times in /proc.
const TICKS_PER_SECOND: f64 = 100.0;
/// User time and system time are the 14th and the 15th field of /proc/PID/stat; the 3rd is the first after the name.
const FIELDS_BEFORE: usize = 11;

/// CPU time of a process so far, seconds.
fn cpu_s(process: u32) -> Result<f64> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).context("`gleaner run` has ended")?;
    let (_, fields) = stat.rsplit_once(')').context("/proc/PID/stat has no name")?;
    let times = fields.split_whitespace().skip(FIELDS_BEFORE).take(2);
    let ticks: f64 = times.filter_map(|field| field.parse::<f64>().ok()).sum();
    Ok(ticks / TICKS_PER_SECOND)
}

/// CPU time and memory.
pub(super) fn flight(page: &mut String) -> Result<()> {
    let serving = Serving::at_speed("1", Link::Tcp, &[]);
    let process = serving.pilot.id();
    let arguments = [format!("udpout:{}", serving.station), DECISIONS.to_string()];
    let mut station = Peer::start(&python::interpreter()?, "flight_bench.py", &arguments)?;
    let before = cpu_s(process)?;
    let period_s = station.round("fly")? * 1e-6;
    let used_s = cpu_s(process)? - before;
    let status = fs::read_to_string(format!("/proc/{process}/status"))?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("unknown").trim();
    let flown_s = period_s * f64::from(DECISIONS);
    writeln!(
        page,
        "## Flight\n\n`gleaner run` with look-ahead beside `gleaner-sitl serve` in real time, logs on, {DECISIONS} decisions in \
         {flown_s:.0} s: {used_s:.2} s of CPU time, {:.1} % of a core. Peak memory {peak}.",
        100.0 * used_s / flown_s
    )?;
    Ok(())
}
