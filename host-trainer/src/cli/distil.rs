//! `gleaner-train distil`: imitation of the planner, of the look-ahead or of trained policies.

use super::policy_of;
use super::session::{Session, SessionArguments};
use anyhow::Result;
use gleaner_host_trainer::learn::distil::{Distillation, Teaching};
use gleaner_host_trainer::systems::System;
use gleaner_lookahead::Budget;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Start with the parameters of this run's folder, or of this exported model.
    #[arg(long, value_name = "PATH")]
    from: Option<PathBuf>,
    /// Imitate this run's folder or exported model, with its mean over the eight views of each state, instead of the planner.
    /// Repeatable: the mean of several runs.
    #[arg(long, value_name = "PATH", conflicts_with = "lookahead")]
    mentor: Vec<PathBuf>,
    /// Imitate the look-ahead that flies, with this many tours per decision, instead of the planner: it starts from the
    /// student's action and knows no more than the student.
    #[arg(long, value_name = "TOURS", value_parser = clap::value_parser!(u32).range(1..))]
    lookahead: Option<u32>,
    #[command(flatten)]
    session: SessionArguments,
}

pub fn run(arguments: &mut Arguments) -> Result<()> {
    let Arguments { from, mentor, lookahead, session } = arguments;
    let from = from.as_deref().map(policy_of).transpose()?;
    let mentors = mentor.iter().map(|path| policy_of(path));
    let mentors = mentors.collect::<Result<Vec<_>>>()?;
    let teaching = match *lookahead {
        Some(tours) => Teaching::LookAhead(Budget { tours }),
        None if mentors.is_empty() => Teaching::Planner,
        None => Teaching::Mentors(mentors),
    };
    let site = session.site.open(&mut session.settings)?;
    let console = Session::open(System::Gleaner, session, None)?;
    console.run(Distillation::open(session.settings.clone(), site, &session.out, from.as_ref(), teaching)?)
}
