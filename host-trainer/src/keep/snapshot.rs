//! What a run leaves behind: the best parameters, which system they are of, and how to fly them.

use crate::env::flight::Flight;
use crate::judge::evaluation::{Decider, DeciderError, Network};
use crate::keep::checkpoint::{self, CheckpointError};
use crate::learn::learner::{Asked, DdqnCgl, Learner, MosacAtt, MosacCgl, MosacFtv};
use crate::learn::settings::{Settings, as_json};
use crate::net::Shape;
use crate::observe::encoding::Encoding;
use crate::systems::System;
use gleaner_units::Action;
use gleaner_world::World;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// The best parameters' name inside the output folder.
pub const LEARNED: &str = "learned.checkpoint";
/// The folder inside the output folder that holds the parameters as they stand, where the output folder has the best.
pub const LAST: &str = "last";

/// The best parameters of a run by validation, and how they came about: what `evaluate` and `export` read.
///
/// In the file the system's name stands before everything else.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Learned {
    /// Whose parameters they are.
    #[serde(skip)]
    pub system: System,
    /// The command that made them: `train` or `distil`, with what is not a setting.
    pub method: String,
    /// Its settings.
    #[serde(with = "as_json")]
    pub settings: Settings,
    /// The network that decides: the actor, or the values of DDQN.
    pub actor: Vec<f32>,
    /// Update at which it was found.
    pub update: u64,
    /// Slots flown until then.
    pub steps: u64,
    /// [`crate::judge::validation::Tables::score`] on the validation realizations.
    pub score: f64,
}

/// Why learned parameters cannot be used.
#[derive(Debug, Error)]
pub enum LearnedError {
    /// The file.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// It does not say whose parameters it holds.
    #[error("{}: holds no system of this version; train it anew", path.display())]
    UnknownSystem {
        /// The file.
        path: PathBuf,
    },
    /// Parameters of a network with other shapes.
    #[error(
        "{}: {found} parameters, and {system} has {expected} in this version; train it anew",
        path.display()
    )]
    OtherNetwork {
        /// The file.
        path: PathBuf,
        /// Whose parameters it says they are.
        system: System,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// Another system than the one that can be used here.
    #[error("{}: holds a policy of {found}; give a run of {expected}", path.display())]
    OtherSystem {
        /// The file.
        path: PathBuf,
        /// Whose parameters they are.
        found: System,
        /// Whose they should be.
        expected: System,
    },
}

impl Learned {
    /// Reads what a run in `folder` has learned so far; `None` before its first validation.
    ///
    /// # Errors
    /// The file is damaged, or holds the parameters of another network.
    pub fn load(folder: &Path) -> Result<Option<Learned>, LearnedError> {
        let path = folder.join(LEARNED);
        if !path.exists() {
            return Ok(None);
        }
        let named = checkpoint::load_named(&path)?;
        let Ok(system) = named.name().parse() else { return Err(LearnedError::UnknownSystem { path }) };
        let learned = Learned { system, ..named.value()? };
        let found = learned.actor.len();
        let expected = system.parameter_count();
        if found == expected {
            Ok(Some(learned))
        } else {
            Err(LearnedError::OtherNetwork { path, system, found, expected })
        }
    }

    /// As [`Learned::load`] where only one system will do.
    ///
    /// # Errors
    /// Those of [`Learned::load`]; it is of another system.
    pub fn load_of(system: System, folder: &Path) -> Result<Option<Learned>, LearnedError> {
        match Learned::load(folder)? {
            Some(Learned { system: found, .. }) if found != system => {
                Err(LearnedError::OtherSystem { path: folder.join(LEARNED), found, expected: system })
            }
            learned => Ok(learned),
        }
    }

    /// Takes the place of `best` if it is better by validation.
    pub fn offer(self, best: &mut Option<Learned>) {
        if best.as_ref().is_none_or(|best| self.score > best.score) {
            *best = Some(self);
        }
    }

    /// Writes it.
    ///
    /// # Errors
    /// The disk; the last good file is then still there.
    pub fn save(&self, folder: &Path) -> Result<(), CheckpointError> {
        checkpoint::save_named(&folder.join(LEARNED), self.system.name(), self)
    }

    /// Writes it into a folder that may not exist yet.
    ///
    /// # Errors
    /// The disk; the last good file is then still there.
    pub fn save_in(&self, folder: &Path) -> Result<(), CheckpointError> {
        std::fs::create_dir_all(folder)
            .map_err(|source| CheckpointError::Io { path: folder.to_path_buf(), source })?;
        self.save(folder)
    }

    /// What flies it in an evaluation, in batches, in any city.
    #[must_use]
    pub fn decider(&self) -> Box<dyn Decider + '_> {
        match self.system {
            // The same numbers, and it tells its attention.
            System::Gleaner => Box::new(Network::new(Shape::actor(), &self.actor)),
            System::MosacAtt => Box::new(Trained::<MosacAtt>::new(&self.actor)),
            System::MosacCgl => Box::new(Trained::<MosacCgl>::new(&self.actor)),
            System::DdqnCgl => Box::new(Trained::<DdqnCgl>::new(&self.actor)),
            System::MosacFtv => Box::new(Trained::<MosacFtv>::new(&self.actor)),
        }
    }
}

/// A system's network, deciding without exploring.
pub struct Trained<'a, L: Learner> {
    parameters: &'a [f32],
    asked: Asked<L::Encoding>,
    /// The encoding, and the world that it was made for.
    sees: Option<(Arc<World>, L::Encoding)>,
}

impl<'a, L: Learner> Trained<'a, L> {
    /// The deciding network with these parameters.
    #[must_use]
    pub fn new(parameters: &'a [f32]) -> Trained<'a, L> {
        Trained { parameters, asked: Asked::new(L::network()), sees: None }
    }
}

impl<L: Learner> Decider for Trained<'_, L> {
    /// # Panics
    /// When the flights are not all in one world.
    fn decide(&mut self, flights: &[&Flight]) -> Result<Vec<Action>, DeciderError> {
        let Some(first) = flights.first() else { return Ok(Vec::new()) };
        let world = first.episode().world();
        assert!(
            flights.iter().all(|flight| Arc::ptr_eq(flight.episode().world(), world)),
            "one world at a time"
        );
        if !self.sees.as_ref().is_some_and(|(known, _)| Arc::ptr_eq(known, world)) {
            self.sees = Some((Arc::clone(world), L::Encoding::of(world)));
        }
        let Some((_, encoding)) = &self.sees else { return Ok(Vec::new()) };
        let seen: Vec<_> = flights.iter().map(|flight| encoding.observe(flight)).collect();
        let states = seen.iter().zip(flights).map(|(seen, flight)| (seen, flight.preference()));
        let answers = self.asked.answer(encoding, self.parameters, states);
        let answers = answers.chunks_exact(answers.len() / flights.len());
        flights
            .iter()
            .zip(answers)
            .map(|(flight, answer)| {
                let scores = L::scores(answer, flight.preference());
                let action = flight.mask().argmax(&scores);
                action.ok_or_else(|| DeciderError("the network's answer is not a number".into()))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::evaluation::{evaluate, realizations};
    use gleaner_world::Scenario;

    fn learned(system: System) -> Learned {
        Learned {
            system,
            method: "train".into(),
            settings: Settings::default(),
            actor: vec![0.01; system.parameter_count()],
            update: 7,
            steps: 28,
            score: 1.5,
        }
    }

    #[test]
    fn what_was_learned_comes_back_and_flies() {
        let world = Arc::new(World::default_world());
        let drawn = realizations(&world, &Scenario::reach_destination().with_devices(12), 1).unwrap();
        for system in System::ALL {
            let folder = tempfile::tempdir().unwrap();
            learned(system).save(folder.path()).unwrap();
            let back = Learned::load_of(system, folder.path()).unwrap().unwrap();
            assert_eq!((back.system, &back.actor), (system, &learned(system).actor));
            let table = evaluate(&world, &drawn, &mut *back.decider()).unwrap();
            assert!(table.rows.iter().all(|row| row.energy >= 32.0 && row.energy <= 80.0), "{system}");
        }
    }

    #[test]
    fn a_file_without_a_system_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        checkpoint::save(&folder.path().join(LEARNED), &learned(System::Gleaner)).unwrap();
        let error = Learned::load(folder.path()).unwrap_err();
        assert!(matches!(error, LearnedError::UnknownSystem { .. }), "{error}");
    }

    #[test]
    fn parameters_of_another_network_or_system_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        learned(System::MosacCgl).save(folder.path()).unwrap();
        let error = Learned::load_of(System::MosacAtt, folder.path()).unwrap_err();
        assert!(matches!(error, LearnedError::OtherSystem { found: System::MosacCgl, .. }), "{error}");
        let mut older = learned(System::MosacFtv);
        older.actor.pop();
        older.save(folder.path()).unwrap();
        let error = Learned::load(folder.path()).unwrap_err();
        assert!(matches!(error, LearnedError::OtherNetwork { found: 84_228, .. }), "{error}");
        assert!(!error.to_string().contains('\n'), "one line");
    }
}
