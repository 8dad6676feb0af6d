//! Benchmarks against peers, as ratios of medians in one run.
//!
//! # Glossary
//! - **part**: one section of `docs/benchmarks.md`.
//! - **peer**: the program that a user would choose instead.
//! - **spread**: the quartiles of the ratios of paired repetitions.

mod engine;
mod golden;
mod learning;
mod machine;
mod programs;
mod timing;
mod wire;
mod world;

use anyhow::{Context, Result, bail};
use std::fmt::Write;
use std::fs;

/// Name and function of each part.
type Part = (&'static str, fn(&mut String) -> Result<()>);

const PARTS: [Part; 7] = [
    ("engine", engine::inference),
    ("observation", engine::observation),
    ("world", world::steps),
    ("learning", learning::updates),
    ("wire", wire::packets),
    ("programs", programs::programs),
    ("sweep", programs::sweep),
];
const FILE: &str = "docs/benchmarks.md";

/// Measures the named parts, all if none is named. Prints them, and writes the file if all were measured.
///
/// # Errors
/// An unknown part, a peer that cannot be installed, or a file that cannot be written.
pub fn run(wanted: &[String]) -> Result<()> {
    if let Some(unknown) = wanted.iter().find(|name| PARTS.iter().all(|(part, _)| part != name)) {
        let parts: Vec<&str> = PARTS.iter().map(|(part, _)| *part).collect();
        bail!("unknown part `{unknown}`: choose of {}", parts.join(", "));
    }
    let mut page = machine::preamble()?;
    for (_, measure) in
        PARTS.iter().filter(|(part, _)| wanted.is_empty() || wanted.iter().any(|name| name == part))
    {
        let mut section = String::new();
        measure(&mut section)?;
        println!("{section}");
        write!(page, "\n{section}")?;
    }
    if wanted.is_empty() {
        let path = crate::programs::repository().join(FILE);
        fs::write(&path, page).with_context(|| format!("{} cannot be written", path.display()))?;
        println!("wrote {FILE}");
    }
    Ok(())
}
