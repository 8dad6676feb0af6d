//! Whole decisions, as `gleaner bench` measures them.

use crate::programs::{path, repository};
use anyhow::{Result, ensure};
use std::fmt::Write;
use std::process::Command;

/// The output of `gleaner bench`.
pub(super) fn decisions(page: &mut String) -> Result<()> {
    let output = Command::new(path("gleaner"))
        .args(["bench", "--inferences", "201"])
        .current_dir(repository())
        .output()?;
    let said = String::from_utf8_lossy(&output.stdout);
    ensure!(output.status.code() != Some(2), "gleaner bench: {}", String::from_utf8_lossy(&output.stderr));
    writeln!(
        page,
        "## Decision\n\n`gleaner bench`, which any user can repeat:\n\n```text\n{}\n```",
        said.trim()
    )?;
    Ok(())
}
