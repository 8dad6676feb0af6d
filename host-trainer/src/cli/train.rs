//! `gleaner-train train`: off-policy learning.

use super::session::{Session, SessionArguments};
use anyhow::{Result, bail};
use clap::ArgMatches;
use gleaner_host_trainer::learn::algorithm::Algorithm;
use gleaner_host_trainer::learn::run::OffPolicyRun;
use gleaner_host_trainer::settings::Preset;
use gleaner_host_trainer::systems::{DdqnCgl, Gleaner, MosacAtt, MosacAttLayers, MosacCgl, MosacFtv, System};
use std::fmt;
use std::str::FromStr;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The system to train: gleaner, the one that flies on board, or one of the paper's, mosac-att, mosac-cgl, ddqn-cgl
    /// or mosac-ftv. Only gleaner can be exported.
    #[arg(long, default_value = "gleaner")]
    system: System,
    /// A named set of settings; explicit flags override it. `paper` is the paper's training: learning rate 3e-4, batch
    /// 32, replay 100,000, gamma 0.99, J = 3, target entropy 0.6 to 0.3, tau 5 to 1.5 over 100,000 environment steps,
    /// 1.5 million steps at one update per four, the heated softmax as the policy, uniform preferences, validation on
    /// the 100 evaluation realizations every 20,000 steps.
    #[arg(long)]
    preset: Option<Preset>,
    /// Local map of mosac-att: `heights`, since the other layers repeat what the tokens have, or `four-layers`, all of
    /// the paper's S^CL.
    #[arg(long, default_value_t = LocalMap::Heights)]
    local_map: LocalMap,
    #[command(flatten)]
    session: SessionArguments,
}

/// The local map of MOSAC-ATT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LocalMap {
    Heights,
    FourLayers,
}

impl fmt::Display for LocalMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            LocalMap::Heights => "heights",
            LocalMap::FourLayers => "four-layers",
        })
    }
}

impl FromStr for LocalMap {
    type Err = String;

    fn from_str(name: &str) -> Result<LocalMap, String> {
        [LocalMap::Heights, LocalMap::FourLayers]
            .into_iter()
            .find(|map| map.to_string() == name)
            .ok_or_else(|| "use heights or four-layers".to_owned())
    }
}

/// Trains a system by trial and error. `matches` are the matches of this subcommand.
pub fn run(arguments: &mut Arguments, matches: &ArgMatches) -> Result<()> {
    let system = match (arguments.system, arguments.local_map) {
        (system, LocalMap::Heights) => system,
        (System::MosacAtt | System::MosacAttLayers, LocalMap::FourLayers) => System::MosacAttLayers,
        (other, LocalMap::FourLayers) => bail!("--local-map four-layers: only mosac-att has it, not {other}"),
    };
    if let Some(preset) = arguments.preset {
        arguments.session.settings = preset.apply(&arguments.session.settings, matches);
    }
    let in_paper = system.parameter_count_in_paper().map(|count| format!(" (paper: {count})"));
    println!("{}: {} parameters{}", system.title(), system.parameter_count(), in_paper.unwrap_or_default());
    match system {
        System::Gleaner => train::<Gleaner>(system, arguments),
        System::MosacAtt => train::<MosacAtt>(system, arguments),
        System::MosacAttLayers => train::<MosacAttLayers>(system, arguments),
        System::MosacCgl => train::<MosacCgl>(system, arguments),
        System::DdqnCgl => train::<DdqnCgl>(system, arguments),
        System::MosacFtv => train::<MosacFtv>(system, arguments),
    }
}

fn train<A: Algorithm>(system: System, arguments: &mut Arguments) -> Result<()> {
    let Arguments { preset, session, .. } = arguments;
    let site = session.site.open(&mut session.settings)?;
    let console = Session::open(system, session, *preset)?;
    console.run(OffPolicyRun::<A>::open(session.settings.clone(), site, &session.out)?)
}
