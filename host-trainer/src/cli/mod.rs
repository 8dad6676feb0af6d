//! The command line: parsing validates, the commands do.

mod evaluate;
mod export;
mod oracle;
mod report;
mod systems;
mod train;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use gleaner_host_trainer::keep::snapshot::Learned;
use gleaner_host_trainer::keep::whole;
use gleaner_host_trainer::systems::System;
use std::path::Path;

/// Learns, evaluates and exports policies for Gleaner.
#[derive(Debug, Parser)]
#[command(name = "gleaner-train", version)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Train a policy; goes on from the last checkpoint in --out if there is one.
    Train(train::TrainArguments),
    /// Teach a policy what a planner with full knowledge does; resumes like train. Of the settings it uses the
    /// missions, the batch (batch x preferences lessons), the replay size and the learning rates.
    Distil(train::DistilArguments),
    /// Let a policy that was taught learn from its own flights (proximal policy optimisation); resumes like train.
    Refine(train::RefineArguments),
    /// Print the paper's metrics of a model, a checkpoint and GREEDY.
    Evaluate(evaluate::Arguments),
    /// Find out what a planner that knows map, channel and devices reaches: what policies are measured against.
    Oracle(oracle::Arguments),
    /// Write the best parameters of a run as an ONNX model with its card.
    Export(export::Arguments),
    /// Make one page with all tables and figures of the paper from models and runs, and the CSV files behind it; goes on
    /// where it was stopped.
    Report(report::Arguments),
}

pub fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.command {
        Command::Train(arguments) => train::run(arguments),
        Command::Distil(arguments) => train::distil(arguments),
        Command::Refine(arguments) => train::refine(arguments),
        Command::Evaluate(arguments) => evaluate::run(arguments),
        Command::Oracle(arguments) => oracle::run(arguments),
        Command::Export(arguments) => export::run(arguments),
        Command::Report(arguments) => report::run(arguments),
    }
}

/// So that a kill or a full disk leaves the old file or the new one.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    whole::write(path, bytes).with_context(|| path.display().to_string())
}

/// The best parameters of the run in `folder`, which must be of this system.
fn learned_of(system: System, folder: &Path) -> Result<Learned> {
    Learned::load_of(system, folder)?.with_context(|| {
        format!(
            "{}: no run has been validated here yet; wait for its first line or check --run",
            folder.display()
        )
    })
}
