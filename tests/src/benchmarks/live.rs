//! `gleaner run` in flight, beside a simulated city in real time.

use super::peer::Peer;
use crate::python;
use crate::serving::{Link, Serving};
use anyhow::{Context, Result};
use std::fmt::Write;
use std::fs;

/// Decisions of the measured part of the flight.
const DECISIONS: u32 = 20;
/// `USER_HZ`, the unit of CPU times in /proc.
const TICKS_PER_SECOND: f64 = 100.0;
/// User time and system time are the 14th and the 15th field of /proc/PID/stat; the 3rd is the first after the name.
const FIELDS_BEFORE: usize = 11;
/// Seconds between two decisions of a real aircraft: 20 m at 10 m/s.
const PERIOD_S: f64 = 2.0;

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
    let serving = Serving::start(Link::Tcp, &[]);
    let process = serving.pilot.id();
    let arguments = [format!("udpout:{}", serving.station), DECISIONS.to_string()];
    let mut station = Peer::start(&python::interpreter()?, "flight_bench.py", &arguments)?;
    let before = cpu_s(process)?;
    let period_s = station.round("fly")? * 1e-6;
    let used_s = cpu_s(process)? - before;
    let status = fs::read_to_string(format!("/proc/{process}/status"))?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("unknown").trim();
    let per_decision_s = used_s / f64::from(DECISIONS);
    writeln!(
        page,
        "## Flight\n\n`gleaner run` with look-ahead beside `gleaner-sitl serve --speed 5`, {DECISIONS} decisions, one in \
         {period_s:.2} s: {:.0} ms of CPU time per decision with everything else that the program does meanwhile, {:.1} % of a \
         core. At one decision in {PERIOD_S} s, as a real aircraft flies, the same CPU time per decision is {:.1} %. Peak \
         memory {peak}.",
        1e3 * per_decision_s,
        100.0 * per_decision_s / period_s,
        100.0 * per_decision_s / PERIOD_S
    )?;
    Ok(())
}
