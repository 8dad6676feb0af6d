//! The command line: one file per command.

mod chosen;
mod compare;
mod distil;
mod evaluate;
mod export;
mod mismatch;
mod model;
mod oracle;
mod refine;
mod report;
mod scenario;
mod session;
mod site;
mod subject;
mod train;

pub use session::Interrupted;

use anyhow::{Context, Result};
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use gleaner_host_trainer::export::read_policy;
use gleaner_host_trainer::keep::snapshot::Snapshot;
use gleaner_host_trainer::keep::whole;
use gleaner_host_trainer::settings::Settings;
use gleaner_host_trainer::systems::{self, System};
use std::path::Path;

/// Trains, evaluates and exports policies for Gleaner.
#[derive(Debug, Parser)]
#[command(name = "gleaner-train", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Train a policy by trial and error; continues from the checkpoint in --out if there is one.
    Train(Box<train::Arguments>),
    /// Train a policy to imitate a planner, the look-ahead or trained policies; continues as train does. Of the settings it
    /// uses the missions, the batch (batch x preferences examples), the replay capacity and the learning rates.
    Distil(Box<distil::Arguments>),
    /// Refine a trained policy from its own flights (proximal policy optimisation); continues as train does.
    Refine(Box<refine::Arguments>),
    /// Print the paper's metrics of a model, a run and GREEDY.
    Evaluate(Box<evaluate::Arguments>),
    /// Compare a model with and without look-ahead, GREEDY and the oracle where channel, map or reports differ from what
    /// the aircraft assumes; with 95 % confidence intervals.
    Compare(compare::Arguments),
    /// Compute what a planner with full knowledge of map, channel and devices reaches.
    Oracle(oracle::Arguments),
    /// Write the best parameters of a run as an ONNX model with its card.
    Export(export::Arguments),
    /// Make one page with all tables and figures of the paper from models and runs, and the CSV files behind it;
    /// continues an interrupted measurement.
    Report(report::Arguments),
}

/// Parses the command line and runs the command.
pub fn run() -> Result<()> {
    let matches = Arguments::command().get_matches();
    let mut arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let empty = ArgMatches::default();
    let own = matches.subcommand().map_or(&empty, |(_, own)| own);
    match &mut arguments.command {
        Command::Train(arguments) => train::run(arguments, own),
        Command::Distil(arguments) => distil::run(arguments),
        Command::Refine(arguments) => refine::run(arguments),
        Command::Evaluate(arguments) => evaluate::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Oracle(arguments) => oracle::run(arguments),
        Command::Export(arguments) => export::run(arguments),
        Command::Report(arguments) => report::run(arguments),
    }
}

/// Replaces a file atomically; makes its folder if it does not exist.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    whole::write(path, bytes).with_context(|| path.display().to_string())
}

/// The best parameters of the run in `folder`.
fn snapshot_in(folder: &Path) -> Result<(System, Snapshot)> {
    systems::load(folder)?.with_context(|| no_snapshot(folder))
}

/// As [`snapshot_in`] where only one system is possible.
fn snapshot_of(system: System, folder: &Path) -> Result<Snapshot> {
    systems::load_of(system, folder)?.with_context(|| no_snapshot(folder))
}

/// The policy that a training starts from or imitates: the best parameters of a run's folder, or an exported model.
fn policy_of(path: &Path) -> Result<Snapshot> {
    if path.is_dir() {
        return snapshot_of(System::Gleaner, path);
    }
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let (actor, card) = read_policy(&bytes).with_context(|| path.display().to_string())?;
    // The model holds its whole command, settings included.
    let method = card.command.trim_start_matches("gleaner-train ").replace(" --out RUN", "");
    Ok(Snapshot {
        system: System::Gleaner.name().to_owned(),
        method,
        settings: Settings::default(),
        actor,
        update: 0,
        steps: card.steps,
        score: f64::NEG_INFINITY,
    })
}

fn no_snapshot(folder: &Path) -> String {
    format!("{}: no parameters yet; wait for the run's first validation, or check the path", folder.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn misspelled_subcommand_gets_a_suggestion() {
        let error = Arguments::try_parse_from(["gleaner-train", "evalute"]).unwrap_err().to_string();
        assert!(error.contains("evaluate"), "{error}");
    }
}
