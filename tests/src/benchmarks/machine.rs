//! Where and when the figures were measured.

use crate::programs::repository;
use anyhow::{Context, Result};
use std::process::Command;

fn output(program: &str, arguments: &[&str]) -> Result<String> {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(repository())
        .output()
        .with_context(|| format!("cannot start {program}"))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Title, command, machine, commit and date.
pub(super) fn preamble() -> Result<String> {
    let information = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown");
    let model = model.trim_start_matches([' ', '\t', ':']);
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split_whitespace().next().unwrap_or("unknown").to_owned();
    Ok(format!(
        "# Benchmarks\n\nWritten by `cargo build --release --workspace --bins && target/release/benchmarks` at commit {} on {}. Machine: \
         {model}, {processors} logical processors, load {load} at the start. A load above 0.5 means that \
         other programs ran meanwhile: then compare ratios, not times. Peers run in the same program run, in turns with ours; a ratio is peer / ours, the median of paired repetitions with its quartiles. Above 1, ours is \
         faster.\n",
        output("git", &["rev-parse", "--short", "HEAD"])?,
        output("date", &["-u", "+%Y-%m-%d"])?
    ))
}
