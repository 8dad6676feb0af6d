//! The choice of a report's systems and learning curves by flags, or of all that is shipped.

use super::subject::Subject;
use anyhow::{Result, bail};
use gleaner_host_trainer::keep::curves;
use gleaner_host_trainer::report::Training;
use gleaner_host_trainer::systems::System;
use gleaner_world::ScenarioKind;
use std::path::{Path, PathBuf};

/// Defaults: the shipped model, a folder for each of the paper's systems, and one for each seed of the paper's training.
const SHIPPED: &str = "models/gleaner.onnx";
const SHIPPED_RUNS: &str = "models/paper";
const SHIPPED_TRAININGS: &str = "models/paper/preset";
/// Seeds of the shipped trainings.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=3;

/// A name, if given, and a path.
type Named = (Option<String>, PathBuf);

/// The subjects of the report.
pub struct Chosen {
    models: Vec<Named>,
    runs: Vec<Named>,
    curves: Vec<Named>,
}

impl Chosen {
    /// What the flags name. Without a model and a run: all that is in `models/`.
    pub fn by(models: &[String], runs: &[String], curves: &[String]) -> Chosen {
        let named = |list: &[String]| list.iter().map(|argument| named(argument)).collect();
        let mut chosen = Chosen { models: named(models), runs: named(runs), curves: named(curves) };
        if chosen.models.is_empty() && chosen.runs.is_empty() {
            let runs = System::ALL
                .map(|system| (Some(system.title().to_owned()), Path::new(SHIPPED_RUNS).join(system.name())));
            chosen.models.push((None, SHIPPED.into()));
            chosen.runs.extend(runs.into_iter().filter(|(_, folder)| folder.is_dir()));
            if chosen.curves.is_empty() {
                chosen.curves.extend(shipped_trainings().filter(|(_, folder)| folder.is_dir()));
            }
        }
        chosen
    }

    /// The systems, loaded. Their names differ.
    pub fn systems(&self) -> Result<Vec<Subject>> {
        let mut systems = Vec::new();
        for (name, path) in &self.models {
            systems.push(Subject::model(name.as_deref(), path)?);
        }
        for (name, folder) in &self.runs {
            systems.push(Subject::run(name.as_deref(), folder)?);
        }
        for (index, system) in systems.iter().enumerate() {
            if systems[..index].iter().any(|other| other.name == system.name) {
                bail!(
                    "two systems have the name {}; name them with --model NAME=FILE or --run NAME=FOLDER",
                    system.name
                );
            }
        }
        Ok(systems)
    }

    /// The learning curves of the systems. A run may have none yet.
    pub fn curves(&self) -> Result<Vec<(String, Vec<curves::Point>)>> {
        self.runs.iter().map(|named| Ok((title(named), curve(&named.1)?))).collect()
    }

    /// The runs of --curve, those of one name together.
    pub fn trainings(&self) -> Result<Vec<Training>> {
        let mut trainings: Vec<Training> = Vec::new();
        for named in &self.curves {
            let (folder, name) = (named.1.display().to_string(), title(named));
            let points = curve(&named.1)?;
            if points.is_empty() {
                bail!("{folder}: no learning curve yet; wait for its first point, or check --curve");
            }
            match trainings.iter_mut().find(|training| training.name == name) {
                Some(training) => training.runs.push((folder, points)),
                None => trainings.push(Training { name, runs: vec![(folder, points)] }),
            }
        }
        Ok(trainings)
    }
}

/// The given name, or that of the folder.
fn title((name, folder): &Named) -> String {
    name.clone().unwrap_or_else(|| folder.file_name().unwrap_or(folder.as_os_str()).display().to_string())
}

fn curve(folder: &Path) -> Result<Vec<curves::Point>> {
    if !folder.is_dir() {
        bail!("{}: no such folder; check --run and --curve", folder.display());
    }
    Ok(curves::read(folder)?)
}

/// The runs of the paper's training with its preset: each system, scenario and seed.
fn shipped_trainings() -> impl Iterator<Item = Named> {
    System::ALL.into_iter().flat_map(|system| {
        ScenarioKind::ALL.into_iter().flat_map(move |kind| {
            SEEDS.map(move |seed| {
                let folder = format!("{}-{}-{seed}", system.name(), kind.name());
                (Some(system.title().to_owned()), Path::new(SHIPPED_TRAININGS).join(folder))
            })
        })
    })
}

/// `NAME=PATH`, or a path alone.
fn named(argument: &str) -> Named {
    match argument.split_once('=') {
        Some((name, path)) => (Some(name.to_owned()), path.into()),
        None => (None, argument.into()),
    }
}
