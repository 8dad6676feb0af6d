//! Benchmarks against peers, as ratios of paired repetitions in one run.
//!
//! # Glossary
//! - **part**: one section of `docs/benchmarks.md`.
//! - **peer**: the program that a user would choose instead.
//! - **contender**: a peer or our own code, timed in turns with the others.
//! - **spread**: the quartiles of the ratios of paired repetitions.

mod decision;
mod engine;
mod golden;
mod instructions;
mod latency;
mod learning;
mod live;
mod machine;
mod peer;
mod planning;
mod programs;
mod timing;
mod wire;
mod world;

use anyhow::{Context, Result, bail, ensure};
use std::fs;
use std::time::Instant;

/// Name and function of each part.
type Part = (&'static str, fn(&mut String) -> Result<()>);

const PARTS: [Part; 12] = [
    ("engine", engine::inference),
    ("observation", engine::observation),
    ("decision", decision::decisions),
    ("world", world::steps),
    ("planning", planning::missions),
    ("learning", learning::updates),
    ("wire", wire::packets),
    ("programs", programs::programs),
    ("flight", live::flight),
    ("latency", latency::latency),
    ("sweep", programs::sweep),
    ("instructions", instructions::counts),
];
const FILE: &str = "docs/benchmarks.md";
/// The first argument of a run that callgrind counts.
const COUNTED: &str = "--counted";

/// Measures the named parts, all if none is named, and prints them. If all are measured, writes the file after each part,
/// so that an interrupted run leaves what it has measured.
///
/// # Errors
/// An unknown part, a part that failed (the others are measured all the same), or a file that cannot be written.
pub fn run(wanted: &[String]) -> Result<()> {
    if let [mode, contender, calls] = wanted
        && mode == COUNTED
    {
        return instructions::run(contender, calls.parse().context("the number of calls")?);
    }
    if let Some(unknown) = wanted.iter().find(|name| PARTS.iter().all(|(part, _)| part != name)) {
        let parts: Vec<&str> = PARTS.iter().map(|(part, _)| *part).collect();
        bail!("unknown part `{unknown}`: choose of {}", parts.join(", "));
    }
    let preamble = machine::preamble()?;
    let path = crate::programs::repository().join(FILE);
    let mut sections = String::new();
    let mut failed = Vec::new();
    for (number, (part, measure)) in (1..).zip(PARTS) {
        if !wanted.is_empty() && wanted.iter().all(|name| name != part) {
            continue;
        }
        let begun = Instant::now();
        let mut section = String::new();
        if let Err(cause) = measure(&mut section) {
            section += &format!("\nThe part `{part}` ended early: {cause:#}.\n");
            failed.push(part);
        }
        println!("{section}");
        eprintln!("part {part}: {:.0} s", begun.elapsed().as_secs_f64());
        sections += &format!("\n{section}");
        if wanted.is_empty() {
            let state = format!("Parts measured: {number} of {}.\n", PARTS.len());
            let page = format!("{preamble}\n{state}{sections}");
            fs::write(&path, page).with_context(|| format!("{} cannot be written", path.display()))?;
        }
    }
    ensure!(failed.is_empty(), "ended early: {}", failed.join(", "));
    Ok(())
}
