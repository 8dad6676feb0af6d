//! What can be evaluated: exported models and the runs that learn them.

use super::evaluate::learned;
use super::export::load_model;
use anyhow::{Context, Result, bail};
use gleaner_host_trainer::env::flight::Flight;
use gleaner_host_trainer::judge::evaluation::{self, Decider, realizations};
use gleaner_host_trainer::keep::parts::fingerprint;
use gleaner_host_trainer::learn::run::Learned;
use gleaner_host_trainer::report::Latency;
use gleaner_policy::Preference;
use gleaner_policy::onnx::TractPolicy;
use gleaner_world::{Scenario, World};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Decisions that are timed, after as many that are not.
const TIMED: usize = 2_000;

/// A learned system.
pub struct System {
    /// How it is called.
    pub name: String,
    /// Where it came from and what flies it.
    pub origin: String,
    /// Changes whenever its decisions may.
    pub identity: String,
    /// What decides.
    pub engine: Engine,
}

/// What decides for a learned system.
pub enum Engine {
    /// An exported model in tract.
    Tract(Box<TractPolicy>),
    /// A run's best parameters in the learner's own network.
    Learner(Box<Learned>),
}

impl System {
    /// An ONNX model, called as its card says unless a name is given.
    pub fn model(name: Option<&str>, path: &Path) -> Result<System> {
        let policy = load_model(path)?;
        let info = policy.info();
        let file = path.file_name().unwrap_or(path.as_os_str()).display();
        let hash = &info.sha256[..12.min(info.sha256.len())];
        Ok(System {
            name: name.map_or_else(|| info.card.name.clone(), str::to_owned),
            origin: format!("{file}, SHA-256 {hash}..., flown in tract"),
            identity: format!("tract {}", info.sha256),
            engine: Engine::Tract(Box::new(policy)),
        })
    }

    /// The best parameters of a run, called as its folder unless a name is given.
    pub fn run(name: Option<&str>, folder: &Path) -> Result<System> {
        if !folder.is_dir() {
            bail!("{}: no such folder; check --run", folder.display());
        }
        let learned = learned(folder)?;
        let bytes: Vec<u8> = learned.actor.iter().flat_map(|number| number.to_le_bytes()).collect();
        let hash = fingerprint(&bytes);
        let folder = folder.file_name().unwrap_or(folder.as_os_str()).display().to_string();
        let title = learned.system.title();
        Ok(System {
            name: name.map_or_else(|| format!("{title}, {folder}"), str::to_owned),
            origin: format!(
                "run {folder}: {title}, parameters of update {} ({hash}), flown by the learner's network",
                learned.update
            ),
            identity: format!("{title} {hash}"),
            engine: Engine::Learner(Box::new(learned)),
        })
    }
}

impl Engine {
    /// Ready to fly.
    pub fn decider(&mut self) -> Box<dyn Decider + '_> {
        match self {
            Engine::Tract(policy) => Box::new(evaluation::Engine(&mut **policy)),
            Engine::Learner(learned) => learned.decider(),
        }
    }

    /// Of the policy that decides.
    pub fn parameters(&self) -> usize {
        match self {
            Engine::Tract(policy) => policy.info().parameters,
            Engine::Learner(learned) => learned.actor.len(),
        }
    }

    /// Times decisions at the start of an RD mission with six devices, one at a time.
    pub fn latency(&mut self, world: &Arc<World>) -> Result<Latency> {
        let drawn = realizations(world, &Scenario::reach_destination(), 1)?;
        let (seed, realization) = drawn.first().context("one realization")?;
        let flight = Flight::new(world, realization, *seed, Preference::DATA)?;
        let mut decider = self.decider();
        let mut taken_us = Vec::with_capacity(2 * TIMED);
        for _ in 0..2 * TIMED {
            let start = Instant::now();
            decider.decide(&[&flight])?;
            taken_us.push(start.elapsed().as_secs_f32() * 1e6);
        }
        let mut taken_us = taken_us.split_off(TIMED);
        taken_us.sort_by(f32::total_cmp);
        Ok(Latency {
            median_us: taken_us[TIMED / 2],
            p99_us: taken_us[TIMED * 99 / 100],
            decisions: TIMED as u32,
        })
    }
}
