//! The program that measures what look-ahead would cost on the board, run in the emulator.

use super::{emulator, toolchain};
use anyhow::{Context, Result, ensure};
use std::process::{Command, Stdio};

/// What the program prints, with ticks converted to instructions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LookAheadCost {
    /// RAM of the planner, bytes.
    pub bytes: u64,
    /// Instructions of the beginning of a mission: line of sight of all devices.
    pub begin: u64,
    /// Instructions of each decision with 100 tours.
    pub decisions: Vec<u64>,
    /// Instructions of each observation of twelve devices, which is built without look-ahead too.
    pub tokens: Vec<u64>,
    /// Instructions of each mask of the guard.
    pub masks: Vec<u64>,
    /// Instructions to take in each position of the autopilot, from bytes to the component's state.
    pub received: Vec<u64>,
    /// Instructions to send each target, from its coordinates to bytes.
    pub sent: Vec<u64>,
}

impl LookAheadCost {
    /// Builds the program and runs it.
    ///
    /// # Errors
    /// It cannot be built, the emulator is missing, or its output makes no sense.
    pub fn measure() -> Result<LookAheadCost> {
        emulator::check_version()?;
        let program = toolchain::build(toolchain::LOOKAHEAD_COST)?;
        let output = Command::new(emulator::PROGRAM)
            .args(["-M", emulator::MACHINE, "-display", "none", "-monitor", "none", "-serial", "null"])
            .args(["-semihosting-config", "enable=on,target=native", "-icount", "shift=0", "-kernel"])
            .arg(program)
            .stdin(Stdio::null())
            .output()?;
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8_lossy(&said);
        let mut lines = said.lines().filter_map(|line| {
            let (name, value) = line.split_once(' ')?;
            Some((name, value.parse::<u64>().ok()?))
        });
        let (name, million) = lines.next().with_context(|| format!("no calibration: {said}"))?;
        ensure!(name == "million" && million > 0, "no calibration: {said}");
        let mut cost = LookAheadCost::default();
        for (name, value) in lines {
            let instructions = value * 1_000_000 / million;
            match name {
                "bytes" => cost.bytes = value,
                "begin" => cost.begin = instructions,
                "decision" => cost.decisions.push(instructions),
                "tokens" => cost.tokens.push(instructions),
                "mask" => cost.masks.push(instructions),
                "received" => cost.received.push(instructions),
                "sent" => cost.sent.push(instructions),
                "length" => ensure!(value > 12, "no target was sent: {said}"),
                _ => {}
            }
        }
        ensure!(!cost.decisions.is_empty() && !cost.sent.is_empty(), "no decision: {said}");
        Ok(cost)
    }
}
