//! The golden packets of the link crate.

use crate::programs::repository;
use anyhow::{Context, Result};
use std::fs;

/// The packet with this name, made by pymavlink.
pub(super) fn golden_packet(name: &str) -> Result<Vec<u8>> {
    let golden = fs::read_to_string(repository().join("firmware/link/tests/golden/packets.txt"))?;
    let line = golden.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    let hex = line.with_context(|| format!("no golden packet {name}"))?;
    let byte = |at: usize| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16);
    (0..hex.len() / 2).map(byte).collect::<Result<_, _>>().context("not hexadecimal")
}
