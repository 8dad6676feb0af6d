//! `gleaner-train refine`: proximal policy optimisation of a trained policy.

use super::policy_of;
use super::session::{Session, SessionArguments};
use anyhow::{Result, bail};
use gleaner_host_trainer::learn::ppo::Refinement;
use gleaner_host_trainer::systems::System;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Start with the parameters of this run's folder, or of this exported model. Repeatable: the mean of the parameters of
    /// runs with the same start. FOLDER has the best parameters by validation, FOLDER/last the last ones.
    #[arg(long, required = true, value_name = "PATH")]
    from: Vec<PathBuf>,
    /// Factor on the logits at the start: 2.5 for a distilled policy, which is uncertain, 1 for a refined one.
    #[arg(long, default_value_t = 2.5)]
    confidence: f32,
    #[command(flatten)]
    session: SessionArguments,
}

pub fn run(arguments: &mut Arguments) -> Result<()> {
    let Arguments { from, confidence, session } = arguments;
    if !(confidence.is_finite() && *confidence > 0.0) {
        bail!("--confidence {confidence}: a number above 0");
    }
    let from = from.iter().map(|path| policy_of(path));
    let from = from.collect::<Result<Vec<_>>>()?;
    let [first, others @ ..] = &from[..] else { bail!("--from: name a run") };
    let site = session.site.open(&mut session.settings)?;
    let console = Session::open(System::Gleaner, session, None)?;
    console.run(Refinement::open(session.settings.clone(), site, &session.out, first, others, *confidence)?)
}
