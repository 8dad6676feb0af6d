//! Instructions counted by callgrind: steadier than a clock on a machine with other load.
//!
//! The program starts itself under callgrind with two numbers of calls. The difference of the counts belongs to the calls,
//! and the start cancels out.

use super::{COUNTED, engine, wire, world};
use anyhow::{Context, Result, bail};
use std::fmt::Write;
use std::process::Command;

const CALLS: [u64; 2] = [20, 60];

/// Something to count: makes the calls.
type Counted = (&'static str, &'static str, fn(u64) -> Result<()>);

const CONTENDERS: [Counted; 6] = [
    ("vectorised", "inference, 12 devices, native vectorised (AVX2)", |calls| {
        engine::count("vectorised", calls)
    }),
    ("portable", "inference, 12 devices, native portable", |calls| engine::count("portable", calls)),
    ("tract", "inference, 12 devices, tract", |calls| engine::count("tract", calls)),
    ("step", "100 environment steps with guard and tokens, 6 devices", world::count),
    ("world", "100 environment steps", world::count_world),
    ("packets", "MAVLink stream of 2,000 packets, read", wire::count),
];

/// The table of counts.
pub(super) fn counts(page: &mut String) -> Result<()> {
    writeln!(
        page,
        "## Instructions\n\nInstructions per call, counted by callgrind in user space. Callgrind has no AVX-512.\n\n\
         | call | instructions |\n|---|---|"
    )?;
    for (name, what, _) in CONTENDERS {
        let [few, many] = [callgrind(name, CALLS[0])?, callgrind(name, CALLS[1])?];
        writeln!(page, "| {what} | {} |", many.saturating_sub(few) / (CALLS[1] - CALLS[0]))?;
    }
    Ok(())
}

/// Makes the calls of a contender, under callgrind.
pub(super) fn run(contender: &str, calls: u64) -> Result<()> {
    let found = CONTENDERS.iter().find(|(name, ..)| *name == contender);
    let (_, _, call) = found.with_context(|| format!("no contender {contender}"))?;
    call(calls)
}

/// Instructions of this program with these arguments.
fn callgrind(contender: &str, calls: u64) -> Result<u64> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(std::env::current_exe()?)
        .args([COUNTED, contender, &calls.to_string()])
        .output()
        .context("cannot start valgrind: install it")?;
    let said = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        bail!("valgrind: {}", said.lines().next_back().unwrap_or_default());
    }
    let collected = said.lines().find_map(|line| line.split_once("Collected : ")?.1.trim().parse().ok());
    collected.with_context(|| format!("valgrind printed no count: {said}"))
}
