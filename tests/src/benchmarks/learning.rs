//! Updates of the learning algorithm against PyTorch.

use super::timing::in_turns;
use crate::programs::repository;
use crate::python;
use anyhow::Result;
use std::fmt::Write;
use std::process::Command;

#[path = "../../../host-trainer/benches/twin/mod.rs"]
mod twin;

const ROUNDS: usize = 20;
const UPDATES: usize = 2;

/// One update of MOSAC: 96 samples, three networks.
pub(super) fn updates(page: &mut String) -> Result<()> {
    let mut twin = twin::Twin::new();
    in_turns(&mut [("warm-up", Box::new(|| twin.update()))], 2, UPDATES);
    let ours = in_turns(&mut [("update", Box::new(|| twin.update()))], ROUNDS, UPDATES);
    let median = ours[0].median();
    writeln!(
        page,
        "## Learning\n\nOne update of MOSAC on one thread: {} samples of six devices, three forward passes for the \
         targets, forward and backward passes of two critics and the actor, Adam, Polyak averages.\n\n\
         | program | time | updates/s |\n|---|---|---|",
        twin::SAMPLES
    )?;
    writeln!(page, "| `gleaner-train` | {} | {:.0} |", ours[0].text(), 1e6 / median)?;
    match pytorch()? {
        Some(wall_us) => writeln!(
            page,
            "| PyTorch, eager, directly after | {wall_us:.0} us (minimum) | {:.0} |\n\nPyTorch / ours, minima: {:.2}.",
            1e6 / wall_us,
            wall_us / ours[0].minimum()
        )?,
        None => writeln!(
            page,
            "\nPyTorch is not in the environment of the tests. `python3 host-trainer/scripts/compare_with_pytorch.py` \
             compares with an installed one."
        )?,
    }
    Ok(())
}

/// The minimum of PyTorch's time, microseconds; `None` where it is not installed.
fn pytorch() -> Result<Option<f64>> {
    let script = repository().join("host-trainer/scripts/pytorch_update_bench.py");
    let output = Command::new(python::interpreter()?).arg(script).arg("5").output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let mut words = text.split_whitespace().skip_while(|word| *word != "wall_ms").skip(1);
    Ok(words.next().and_then(|number| number.parse::<f64>().ok()).map(|ms| ms * 1e3))
}
