//! `gleaner-train train`, `distil` and `refine`: three ways of learning, one loop.

use super::learned_of;
use anyhow::{Context, Result, bail};
use gleaner_host_trainer::keep::curves::{Curves, scalars_in};
use gleaner_host_trainer::learn::distil::Distillation;
use gleaner_host_trainer::learn::learner::{DdqnCgl, Gleaner, Learner, MosacAtt, MosacCgl, MosacFtv};
use gleaner_host_trainer::learn::learning::Learning;
use gleaner_host_trainer::learn::ppo::Refinement;
use gleaner_host_trainer::learn::run::{Learned, Run, Tables};
use gleaner_host_trainer::learn::settings::Settings;
use gleaner_host_trainer::systems::System;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Display;
use std::fs;
use std::io::IsTerminal;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the run: checkpoint and learning curve.
    #[arg(long)]
    out: PathBuf,
    /// Updates between two checkpoints: what a kill can cost [default: 2500, refine: 25]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint_every: Option<u64>,
    /// Updates between two validations [default: 5000, refine: 100]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    validate_every: Option<u64>,
    #[command(flatten)]
    settings: Settings,
}

/// What only learning by trial takes.
#[derive(Debug, clap::Args)]
pub struct TrainArguments {
    /// What learns: gleaner, the policy that flies, or one of the paper's systems, mosac-att, mosac-cgl, ddqn-cgl or
    /// mosac-ftv. Only gleaner can be exported.
    #[arg(long, default_value = "gleaner")]
    system: System,
    #[command(flatten)]
    usual: Arguments,
}

/// What only the distillation takes.
#[derive(Debug, clap::Args)]
pub struct DistilArguments {
    /// Begin with what the run in this folder has learned.
    #[arg(long)]
    from: Option<PathBuf>,
    /// Learn what the run in this folder decides, in the mean of the eight views of each situation, instead of what the
    /// planner plans. Repeatable: the mean of several.
    #[arg(long, value_name = "FOLDER")]
    mentor: Vec<PathBuf>,
    #[command(flatten)]
    usual: Arguments,
}

/// What only the refinement takes.
#[derive(Debug, clap::Args)]
pub struct RefineArguments {
    /// Begin with what the run in this folder has learned. Repeatable: with the mean of the weights of runs that began
    /// alike. FOLDER/last is where a refinement stands, FOLDER its best by validation.
    #[arg(long, required = true, value_name = "FOLDER")]
    from: Vec<PathBuf>,
    /// Its logits are multiplied by this first: what was taught is unsure, what was refined is not (1).
    #[arg(long, default_value_t = 2.5)]
    confidence: f32,
    #[command(flatten)]
    usual: Arguments,
}

/// Learns by trial: the policy that flies or one of the paper's systems.
pub fn run(arguments: &TrainArguments) -> Result<()> {
    let TrainArguments { system, usual } = arguments;
    let in_paper = system.parameter_count_in_paper().map(|count| format!(" (the paper: {count})"));
    println!("{}: {} parameters{}", system.title(), system.parameter_count(), in_paper.unwrap_or_default());
    match system {
        System::Gleaner => by_trial::<Gleaner>(usual),
        System::MosacAtt => by_trial::<MosacAtt>(usual),
        System::MosacCgl => by_trial::<MosacCgl>(usual),
        System::DdqnCgl => by_trial::<DdqnCgl>(usual),
        System::MosacFtv => by_trial::<MosacFtv>(usual),
    }
}

fn by_trial<L: Learner>(arguments: &Arguments) -> Result<()> {
    Desk::open(L::SYSTEM, arguments)?.learn(Run::<L>::open(arguments.settings.clone(), &arguments.out)?)
}

/// Learns from the planner: distillation.
pub fn distil(arguments: &DistilArguments) -> Result<()> {
    let DistilArguments { from, mentor, usual } = arguments;
    let from = from.as_deref().map(|folder| learned_of(System::Gleaner, folder)).transpose()?;
    let mentors = mentor.iter().map(|folder| learned_of(System::Gleaner, folder));
    let mentors = mentors.collect::<Result<Vec<_>>>()?;
    let desk = Desk::open(System::Gleaner, usual)?;
    desk.learn(Distillation::open(usual.settings.clone(), &usual.out, from.as_ref(), mentors)?)
}

/// Learns from its own flights: refinement.
pub fn refine(arguments: &RefineArguments) -> Result<()> {
    let RefineArguments { from, confidence, usual } = arguments;
    let from = from.iter().map(|folder| learned_of(System::Gleaner, folder));
    let from = from.collect::<Result<Vec<_>>>()?;
    let [first, others @ ..] = &from[..] else { bail!("--from: name a run") };
    let desk = Desk::open(System::Gleaner, usual)?;
    desk.learn(Refinement::open(usual.settings.clone(), &usual.out, first, others, *confidence)?)
}

/// What all ways of learning show and leave in the folder.
struct Desk<'a> {
    system: System,
    arguments: &'a Arguments,
    bar: ProgressBar,
    best: Option<Learned>,
}

impl<'a> Desk<'a> {
    fn open(system: System, arguments: &'a Arguments) -> Result<Desk<'a>> {
        let Settings { batch, preferences, steps_per_update, replay, .. } = arguments.settings;
        if [batch, preferences, steps_per_update, replay].contains(&0) {
            bail!("--batch, --preferences, --steps-per-update and --replay must be at least 1");
        }
        let out = &arguments.out;
        fs::create_dir_all(out).with_context(|| format!("--out {}", out.display()))?;
        let best = Learned::load_of(system, out)?;
        Ok(Desk { system, arguments, bar: bar(arguments.settings.updates), best })
    }

    /// The loop: updates, and from time to time a point of the curve, a validation, a checkpoint.
    fn learn<L: Learning>(mut self, mut run: L) -> Result<()> {
        // The learning curve goes on from where the run goes on.
        let mut curves = Curves::open(&self.arguments.out, run.update())?;
        self.bar.set_position(run.update());
        self.bar.reset_eta();
        let last = self.arguments.settings.updates;
        let is_due = |update: u64, every: u64| update.is_multiple_of(every) || update == last;
        while !run.is_done() {
            let losses = run.advance()?;
            let update = run.update();
            self.bar.set_position(update);
            if update.is_multiple_of(L::PACE.losses) {
                self.bar.set_message(losses.to_string());
                curves.log(update, &scalars_in(&serde_json::to_value(&losses)?).unwrap_or_default())?;
            }
            if is_due(update, self.arguments.validate_every.unwrap_or(L::PACE.validation)) {
                let tables = run.validate(&mut self.best)?;
                let point = serde_json::json!({ "steps": run.steps(), "losses": losses, "tables": tables });
                curves.log(update, &scalars_in(&point).unwrap_or_default())?;
                self.report(update, &losses, &tables)?;
            }
            if is_due(update, self.arguments.checkpoint_every.unwrap_or(L::PACE.checkpoint)) {
                run.save(&self.arguments.out)?;
            }
        }
        self.end();
        Ok(())
    }

    /// One line for people, whether or not anyone watches the bar; keeps the best.
    fn report(&self, update: u64, losses: &impl Display, tables: &Tables) -> Result<()> {
        if let Some(best) = self.best.as_ref().filter(|best| best.update == update) {
            best.save(&self.arguments.out)?;
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
        if std::io::stderr().is_terminal() {
            self.bar.println(line);
        } else {
            println!("{line}");
        }
        Ok(())
    }

    fn end(&self) {
        self.bar.abandon();
        let out = self.arguments.out.display();
        if self.system == System::Gleaner {
            println!("done; next: gleaner-train export --run {out} --model models/mine.onnx");
        } else {
            println!("done; next: gleaner-train evaluate --run {out}");
        }
    }
}

fn bar(updates: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} updates, {per_sec}, {eta} left  {msg}");
    let bar = ProgressBar::new(updates);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
