//! `gleaner-train train`.

use anyhow::{Context, Result};
use gleaner_host_trainer::settings::Settings;
use gleaner_host_trainer::train::{CURVE, Progress, Run};
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::{self, OpenOptions};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the run: checkpoint and learning curve.
    #[arg(long)]
    out: PathBuf,
    /// Updates between two checkpoints: what a kill can cost.
    #[arg(long, default_value_t = 2_500)]
    checkpoint_every: u64,
    /// Updates between two points of the learning curve.
    #[arg(long, default_value_t = 5_000)]
    validate_every: u64,
    #[command(flatten)]
    settings: Settings,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let out = &arguments.out;
    fs::create_dir_all(out).with_context(|| format!("--out {}", out.display()))?;
    let mut run = Run::open(arguments.settings.clone(), out)?;
    let curve_path = out.join(CURVE);
    let mut curve = OpenOptions::new()
        .create(true)
        .append(true)
        .open(&curve_path)
        .with_context(|| curve_path.display().to_string())?;

    let bar = bar(arguments.settings.updates, run.update());
    while !run.is_done() {
        let losses = run.advance()?;
        bar.set_position(run.update());
        if run.update() % arguments.validate_every == 0 || run.is_done() {
            let progress = run.validate(losses)?;
            writeln!(curve, "{}", serde_json::to_string(&progress)?)
                .with_context(|| curve_path.display().to_string())?;
            report(&bar, &progress);
        }
        if run.update() % arguments.checkpoint_every == 0 || run.is_done() {
            run.save(out)?;
        }
    }
    bar.abandon();
    println!("trained {} updates; next: gleaner-train export --run {}", run.update(), out.display());
    Ok(())
}

fn bar(updates: u64, done: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} updates, {per_sec}, {eta} left {msg}");
    let bar = ProgressBar::new(updates);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.reset_eta();
    bar.set_position(done);
    bar.reset_eta();
    bar
}

/// One line per validation, whether or not anyone watches the bar.
fn report(bar: &ProgressBar, progress: &Progress) {
    let mut line = format!(
        "update {:>7}  steps {:>8}  critic {:.4}  entropy {:.3}  nu {:.5}",
        progress.update,
        progress.steps,
        progress.losses.critic,
        progress.losses.entropy,
        progress.losses.entropy_weight
    );
    for (scenario, table) in &progress.tables {
        line += &format!(
            "  {scenario}: hypervolume {:.0}  coverage {:.1} %  least energy {:.2}",
            table.hypervolume,
            table.coverage(),
            table.least_energy()
        );
    }
    if std::io::stderr().is_terminal() {
        bar.println(line);
    } else {
        println!("{line}");
    }
}
