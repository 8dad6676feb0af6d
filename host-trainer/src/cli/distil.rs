//! `gleaner-train distil`: imitation of the planner or of trained policies.

use super::session::{Session, SessionArguments};
use super::snapshot_of;
use anyhow::Result;
use gleaner_host_trainer::learn::distil::Distillation;
use gleaner_host_trainer::systems::System;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Start with the parameters of the run in this folder.
    #[arg(long, value_name = "FOLDER")]
    from: Option<PathBuf>,
    /// Imitate the run in this folder, with its mean over the eight views of each state, instead of the planner.
    /// Repeatable: the mean of several runs.
    #[arg(long, value_name = "FOLDER")]
    mentor: Vec<PathBuf>,
    #[command(flatten)]
    session: SessionArguments,
}

pub fn run(arguments: &mut Arguments) -> Result<()> {
    let Arguments { from, mentor, session } = arguments;
    let from = from.as_deref().map(|folder| snapshot_of(System::Gleaner, folder)).transpose()?;
    let mentors = mentor.iter().map(|folder| snapshot_of(System::Gleaner, folder));
    let mentors = mentors.collect::<Result<Vec<_>>>()?;
    let site = session.site.open(&mut session.settings)?;
    let console = Session::open(System::Gleaner, session, None)?;
    console.run(Distillation::open(session.settings.clone(), site, &session.out, from.as_ref(), mentors)?)
}
