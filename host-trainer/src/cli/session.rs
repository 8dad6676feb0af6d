//! The loop that all ways of learning share: progress, learning curve, validation, checkpoints, Ctrl-C.

use super::site::SiteArguments;
use anyhow::{Context, Result};
use gleaner_host_trainer::judge::validation::Tables;
use gleaner_host_trainer::keep::curves::{Curves, scalars_in};
use gleaner_host_trainer::keep::snapshot::Snapshot;
use gleaner_host_trainer::learn::trainer::Trainer;
use gleaner_host_trainer::settings::{Preset, Settings};
use gleaner_host_trainer::systems::{self, System};
use indicatif::{ProgressBar, ProgressStyle};
use signal_hook::consts::{SIGINT, SIGTERM};
use std::fmt::Display;
use std::fs;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Time between two progress lines when the output is not a terminal.
const PROGRESS_EVERY: Duration = Duration::from_secs(60);

/// Arguments of `train`, `distil` and `refine`.
#[derive(Debug, clap::Args)]
pub struct SessionArguments {
    /// Folder of the run: checkpoint, learning curve, best and last parameters.
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
    /// Updates between two checkpoints [default: 2500, refine: 25].
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint_every: Option<u64>,
    /// Updates between two validations [default: 5000, refine: 100].
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    validate_every: Option<u64>,
    #[command(flatten)]
    pub site: SiteArguments,
    #[command(flatten)]
    pub settings: Settings,
}

/// Ctrl-C or SIGTERM stopped the run after its checkpoint.
#[derive(Debug, Error)]
#[error("stopped at update {update}; saved in {}; run the same command again to continue", out.display())]
pub struct Interrupted {
    update: u64,
    out: PathBuf,
}

/// A run on the console and in its folder.
pub struct Session {
    system: System,
    out: PathBuf,
    settings: Settings,
    checkpoint_every: Option<u64>,
    validate_every: Option<u64>,
    progress: Progress,
    best: Option<Snapshot>,
    interrupted: Arc<AtomicBool>,
}

impl Session {
    /// Checks the settings and opens the folder. `preset` sets the pace of the validations.
    pub fn open(system: System, arguments: &SessionArguments, preset: Option<Preset>) -> Result<Session> {
        let settings = arguments.settings.clone();
        settings.check()?;
        let out = arguments.out.clone();
        fs::create_dir_all(&out).with_context(|| format!("--out {}", out.display()))?;
        let best = systems::load_of(system, &out)?;
        let interrupted = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // The second signal ends the program at once.
            signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(&interrupted))?;
            signal_hook::flag::register(signal, Arc::clone(&interrupted))?;
        }
        let preset_pace = preset.map(|preset| preset.validate_every(&settings));
        Ok(Session {
            system,
            checkpoint_every: arguments.checkpoint_every,
            validate_every: arguments.validate_every.or(preset_pace),
            progress: Progress::new(settings.updates),
            out,
            settings,
            best,
            interrupted,
        })
    }

    /// Updates with a point of the curve, a validation and a checkpoint at their intervals.
    pub fn run<T: Trainer>(mut self, mut trainer: T) -> Result<()> {
        let mut curves = Curves::open(&self.out, trainer.update())?;
        let (update, updates, out) = (trainer.update(), self.settings.updates, self.out.display());
        match update {
            0 => println!("training {updates} updates in {out}; Ctrl-C saves and stops"),
            _ => println!("continuing from update {update} of {updates} in {out}; Ctrl-C saves and stops"),
        }
        self.progress.start(trainer.update());
        let last = self.settings.updates;
        let is_due = |update: u64, every: u64| update.is_multiple_of(every) || update == last;
        while !trainer.is_done() {
            let losses = trainer.advance()?;
            let update = trainer.update();
            self.progress.advance(update, &losses);
            let mut point = serde_json::json!({ "steps": trainer.steps(), "losses": losses });
            let validates = is_due(update, self.validate_every.unwrap_or(T::PACE.validation));
            if validates {
                let tables = trainer.validate(&mut self.best)?;
                point["tables"] = serde_json::to_value(&tables)?;
                self.report(update, &losses, &tables)?;
            }
            if validates || update.is_multiple_of(T::PACE.losses) {
                curves.log(update, &scalars_in(&point).unwrap_or_default())?;
            }
            let is_interrupted = self.interrupted.load(Ordering::Relaxed);
            if is_interrupted || is_due(update, self.checkpoint_every.unwrap_or(T::PACE.checkpoint)) {
                trainer.save(&self.out)?;
            }
            if is_interrupted && !trainer.is_done() {
                self.progress.bar.abandon();
                return Err(Interrupted { update, out: self.out }.into());
            }
        }
        self.progress.bar.abandon();
        println!("done; next: {}", self.next_command());
        Ok(())
    }

    /// Saves the best parameters when they are new, and prints the metrics.
    fn report(&self, update: u64, losses: &impl Display, tables: &Tables) -> Result<()> {
        if let Some(best) = self.best.as_ref().filter(|best| best.update == update) {
            best.save(&self.out)?;
        }
        let mut line = format!("update {update:>7}  {losses}");
        for (scenario, table) in &tables.0 {
            line += &format!(
                "  {scenario}: hypervolume {:.0}  coverage {:.1} %  least energy {:.2}",
                table.hypervolume,
                table.coverage(),
                table.least_energy()
            );
        }
        self.progress.print(&line);
        Ok(())
    }

    fn next_command(&self) -> String {
        let out = self.out.display();
        if self.system.is_exportable() {
            format!("gleaner-train export --run {out} --model models/mine.onnx")
        } else {
            format!("gleaner-train evaluate --run {out}")
        }
    }
}

/// A bar on a terminal, lines otherwise.
struct Progress {
    bar: ProgressBar,
    is_terminal: bool,
    started: Instant,
    started_at: u64,
    last_line: Instant,
}

impl Progress {
    fn new(updates: u64) -> Progress {
        let style =
            ProgressStyle::with_template("{bar:30} {pos}/{len} updates, {per_sec}, {eta} left  {msg}");
        let bar = ProgressBar::new(updates);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let now = Instant::now();
        Progress {
            bar,
            is_terminal: std::io::stderr().is_terminal(),
            started: now,
            started_at: 0,
            last_line: now,
        }
    }

    fn start(&mut self, update: u64) {
        self.started = Instant::now();
        self.last_line = self.started;
        self.started_at = update;
        self.bar.set_position(update);
        self.bar.reset_eta();
    }

    fn advance(&mut self, update: u64, losses: &impl Display) {
        self.bar.set_position(update);
        if self.is_terminal {
            self.bar.set_message(losses.to_string());
        } else if self.last_line.elapsed() >= PROGRESS_EVERY {
            self.last_line = Instant::now();
            eprintln!("{}", self.line(update, self.started.elapsed(), losses));
        }
    }

    /// `update 1250 of 5000, 12.5 per second, 5 min left  losses`.
    fn line(&self, update: u64, elapsed: Duration, losses: &impl Display) -> String {
        let updates = self.bar.length().unwrap_or(0);
        let rate = (update - self.started_at) as f64 / elapsed.as_secs_f64().max(1e-3);
        let left = (updates.saturating_sub(update) as f64 / rate.max(1e-9) / 60.0).ceil();
        format!("update {update} of {updates}, {rate:.1} per second, {left:.0} min left  {losses}")
    }

    fn print(&self, line: &str) {
        if self.is_terminal {
            self.bar.println(line);
        } else {
            println!("{line}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_line_has_rate_and_time_left() {
        let mut progress = Progress::new(5_000);
        progress.start(250);
        let line = progress.line(1_250, Duration::from_secs(80), &"critic 0.5");
        assert_eq!(line, "update 1250 of 5000, 12.5 per second, 5 min left  critic 0.5");
    }
}
