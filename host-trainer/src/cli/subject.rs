//! The subjects of a report: exported models and runs.

use super::{model, snapshot_in};
use anyhow::{Context, Result, bail};
use gleaner_host_trainer::env::flight::Flight;
use gleaner_host_trainer::judge::evaluation::{self, Decider, realizations};
use gleaner_host_trainer::keep::parts::fingerprint;
use gleaner_host_trainer::keep::snapshot::Snapshot;
use gleaner_host_trainer::report::Latency;
use gleaner_host_trainer::systems::System;
use gleaner_policy::Preference;
use gleaner_policy::onnx::TractPolicy;
use gleaner_world::{Scenario, World};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Decisions that are timed, after the same number for warming up.
const TIMED: usize = 2_000;

/// A trained policy.
pub struct Subject {
    /// Its name in the report.
    pub name: String,
    /// File or run, and the engine.
    pub origin: String,
    /// Changes whenever its decisions may change.
    pub identity: String,
    /// Its policy.
    pub policy: SubjectPolicy,
}

/// The policy of a subject.
pub enum SubjectPolicy {
    /// An exported model in tract.
    Tract(Box<TractPolicy>),
    /// The best parameters of a run in the trainer's network.
    Run(System, Box<Snapshot>),
}

impl Subject {
    /// An ONNX model, named by its card unless a name is given.
    pub fn model(name: Option<&str>, path: &Path) -> Result<Subject> {
        let policy = model::load(path)?;
        let info = policy.info();
        let file = path.file_name().unwrap_or(path.as_os_str()).display();
        let hash = &info.sha256[..12.min(info.sha256.len())];
        Ok(Subject {
            name: name.map_or_else(|| info.card.name.clone(), str::to_owned),
            origin: format!("{file}, SHA-256 {hash}..., flown in tract"),
            identity: format!("tract {}", info.sha256),
            policy: SubjectPolicy::Tract(Box::new(policy)),
        })
    }

    /// The best parameters of a run, named by its folder unless a name is given.
    pub fn run(name: Option<&str>, folder: &Path) -> Result<Subject> {
        if !folder.is_dir() {
            bail!("{}: no such folder; check --run", folder.display());
        }
        let (system, snapshot) = snapshot_in(folder)?;
        let bytes: Vec<u8> = snapshot.actor.iter().flat_map(|number| number.to_le_bytes()).collect();
        let hash = fingerprint(&bytes);
        let folder = folder.file_name().unwrap_or(folder.as_os_str()).display().to_string();
        let title = system.title();
        Ok(Subject {
            name: name.map_or_else(|| format!("{title}, {folder}"), str::to_owned),
            origin: format!(
                "run {folder}: {title}, parameters of update {} ({hash}), flown by the trainer's network",
                snapshot.update
            ),
            identity: format!("{title} {hash}"),
            policy: SubjectPolicy::Run(system, Box::new(snapshot)),
        })
    }
}

impl SubjectPolicy {
    /// Whether its network has attention.
    pub const fn has_attention(&self) -> bool {
        match self {
            SubjectPolicy::Tract(_) => true,
            SubjectPolicy::Run(system, _) => system.has_attention(),
        }
    }

    /// For evaluations.
    pub fn decider(&mut self) -> Box<dyn Decider + '_> {
        match self {
            SubjectPolicy::Tract(policy) => Box::new(evaluation::Engine(&mut **policy)),
            SubjectPolicy::Run(system, snapshot) => system.policy(snapshot),
        }
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        match self {
            SubjectPolicy::Tract(policy) => policy.info().parameters,
            SubjectPolicy::Run(_, snapshot) => snapshot.actor.len(),
        }
    }

    /// Times single decisions at the start of an RD mission with six devices.
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
