//! The training loop, read top to bottom.

use crate::env::flight::{Flight, Reward};
use crate::env::greedy::Greedy;
use crate::judge::evaluation::DeciderError;
use crate::keep::checkpoint::{self, CheckpointError};
use crate::keep::snapshot::Trained;
use crate::learn::learner::{ACTIONS, Asked, Learner};
use crate::learn::learning::{Learning, Pace};
use crate::learn::mosac::Distribution;
use crate::learn::replay::{Replay, Transition};
use crate::learn::settings::{Settings, random_preference};
use crate::net;
use crate::observe::encoding::Encoding;
use crate::systems::System;
use gleaner_units::Action;
use gleaner_world::{ScenarioError, World};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

pub use crate::judge::validation::{Tables, Validation};
pub use crate::keep::snapshot::{LAST, LEARNED, Learned};

/// The checkpoint's name inside the output folder.
pub const CHECKPOINT: &str = "run.checkpoint";
/// The learning curve's name inside the output folder: one JSON object a line.
pub const CURVE: &str = "curve.jsonl";
/// Share of the deciding network that its running average takes over per update. The average is what is judged and
/// shipped: single updates are noisy, and the noise does not fly. It does not act back on the training.
const AVERAGING: f32 = 0.001;

/// Why a run cannot start or go on.
#[derive(Debug, Error)]
pub enum TrainError {
    /// The checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The missions.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The network.
    #[error(transparent)]
    Decider(#[from] DeciderError),
    /// The folder belongs to another run.
    #[error(
        "{}: holds a run with other settings; train into another --out folder, or repeat the settings of that run",
        path.display()
    )]
    OtherSettings {
        /// The checkpoint.
        path: PathBuf,
    },
    /// The folder belongs to a run of another system.
    #[error("{}: holds a run of {found}; train into another --out folder, or give --system {found}", path.display())]
    OtherSystem {
        /// The checkpoint.
        path: PathBuf,
        /// Whose run it is.
        found: System,
    },
}

/// The remembered transitions of a learner.
type Memory<L> = Replay<<<L as Learner>::Encoding as Encoding>::Observation>;

/// A run: everything that the next update depends on.
pub struct Run<L: Learner> {
    settings: Settings,
    world: Arc<World>,
    encoding: L::Encoding,
    learner: L,
    replay: Memory<L>,
    asked: Asked<L::Encoding>,
    flights: Vec<Going>,
    next_mission: u64,
    rng: ChaCha8Rng,
    update: u64,
    steps: u64,
    averaged: Vec<f32>,
    validation: Validation,
}

/// A flight in the air, and how it came there: the checkpoint keeps the way, not the place.
struct Going {
    mission: u64,
    actions: Vec<u8>,
    flight: Flight,
    guide: Option<Greedy>,
}

impl Going {
    /// What the guide would do. To be asked once a slot, since it remembers where it was going.
    fn advice(&mut self) -> Option<Action> {
        self.guide.as_mut().map(|guide| guide.decide(&self.flight))
    }

    fn step(&mut self, action: Action) -> Reward {
        self.actions.push(action.index() as u8);
        self.flight.step(action)
    }
}

/// What the checkpoint keeps; `S`, `L` and `R` are settings, learner and replay, or references to them.
#[derive(Serialize, Deserialize)]
struct Stored<S, L, R> {
    settings: S,
    learner: L,
    replay: R,
    flights: Vec<(u64, Vec<u8>)>,
    next_mission: u64,
    rng_seed: [u8; 32],
    rng_word: u128,
    update: u64,
    steps: u64,
    averaged: Vec<f32>,
}

impl<L: Learner> Run<L> {
    /// Goes on from the checkpoint in `folder`, or starts a new run when there is none.
    ///
    /// # Errors
    /// See [`TrainError`].
    pub fn open(settings: Settings, folder: &Path) -> Result<Run<L>, TrainError> {
        let path = folder.join(CHECKPOINT);
        if !path.exists() {
            return Run::new(settings);
        }
        let named = checkpoint::load_named(&path)?;
        let found = named.name().parse().map_err(|_| CheckpointError::Format { path: path.clone() })?;
        if found != L::SYSTEM {
            return Err(TrainError::OtherSystem { path, found });
        }
        let stored: Stored<Settings, L, Memory<L>> = named.value()?;
        // A finished run may be prolonged.
        if (Settings { updates: settings.updates, ..stored.settings.clone() }) != settings {
            return Err(TrainError::OtherSettings { path });
        }
        Run::restore(settings, stored)
    }

    fn new(settings: Settings) -> Result<Run<L>, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let learner = L::new(&settings, &mut rng);
        let mut run = Run::assemble(settings, learner, rng)?;
        for _ in 0..run.settings.steps_per_update {
            let going = run.next_flight()?;
            run.flights.push(going);
        }
        Ok(run)
    }

    fn restore(settings: Settings, stored: Stored<Settings, L, Memory<L>>) -> Result<Run<L>, TrainError> {
        let mut rng = ChaCha8Rng::from_seed(stored.rng_seed);
        rng.set_word_pos(stored.rng_word);
        let mut run = Run::assemble(settings, stored.learner, rng)?;
        run.replay = stored.replay;
        run.next_mission = stored.next_mission;
        run.update = stored.update;
        run.steps = stored.steps;
        run.averaged = stored.averaged;
        for (mission, actions) in stored.flights {
            let mut going = run.begin(mission)?;
            for action in actions {
                going.advice();
                going.step(Action::from_index(usize::from(action)).unwrap_or(Action::Hover));
            }
            run.flights.push(going);
        }
        Ok(run)
    }

    fn assemble(settings: Settings, learner: L, rng: ChaCha8Rng) -> Result<Run<L>, TrainError> {
        let world = Arc::new(World::default_world());
        let validation = Validation::draw(&world, &settings)?;
        Ok(Run {
            replay: Replay::new(settings.replay),
            settings,
            encoding: L::Encoding::of(&world),
            world,
            averaged: learner.deciding().to_vec(),
            learner,
            asked: Asked::new(L::network()),
            flights: Vec::new(),
            next_mission: 0,
            rng,
            update: 0,
            steps: 0,
            validation,
        })
    }

    fn begin(&self, number: u64) -> Result<Going, ScenarioError> {
        let mission = self.settings.mission(&self.world, number)?;
        let flight = Flight::new(&self.world, &mission.realization, mission.seed, mission.preference)?;
        Ok(Going { mission: number, actions: Vec::new(), flight, guide: mission.guide })
    }

    /// The averaged network as it stands.
    fn last(&self) -> Learned {
        Learned {
            system: L::SYSTEM,
            method: method(L::SYSTEM),
            settings: self.settings.clone(),
            actor: self.averaged.clone(),
            update: self.update,
            steps: self.steps,
            score: f64::NEG_INFINITY,
        }
    }

    fn next_flight(&mut self) -> Result<Going, ScenarioError> {
        let mission = self.next_mission;
        self.next_mission += 1;
        self.begin(mission)
    }

    /// One slot of every flight, explored as the learner does.
    fn fly(&mut self, uniform: bool) -> Result<(), TrainError> {
        let observations: Vec<_> =
            self.flights.iter().map(|going| self.encoding.observe(&going.flight)).collect();
        let scores = self.scores(&observations);
        for (index, (before, scores)) in observations.into_iter().zip(scores).enumerate() {
            let going = &mut self.flights[index];
            let mask_before = going.flight.mask();
            let policy = if uniform {
                Distribution::new(&[0.0; ACTIONS], mask_before)
            } else {
                L::explore(&self.settings, self.update, &scores, mask_before)
            };
            let explored = policy.pick(self.rng.random());
            let guided = !uniform && self.rng.random_bool(0.9);
            let action = going.advice().filter(|_| guided).unwrap_or(explored);
            let reward = going.step(action);
            let over = going.flight.is_over();
            let (after, mask_after) = (self.encoding.observe(&going.flight), going.flight.mask());
            self.replay.push(Transition { before, mask_before, action, reward, after, mask_after, over });
            self.steps += 1;
            if over {
                self.flights[index] = self.next_flight()?;
            }
        }
        Ok(())
    }

    /// What the deciding network says of each action in each flight.
    fn scores(&mut self, observations: &[<L::Encoding as Encoding>::Observation]) -> Vec<[f32; ACTIONS]> {
        let preferences = self.flights.iter().map(|going| going.flight.preference());
        let states = observations.iter().zip(preferences.clone());
        let answers = self.asked.answer(&self.encoding, self.learner.deciding(), states);
        let answers = answers.chunks_exact(answers.len() / observations.len());
        answers.zip(preferences).map(|(answer, preference)| L::scores(answer, preference)).collect()
    }
}

impl<L: Learner> Learning for Run<L> {
    type Losses = L::Losses;
    const PACE: Pace = Pace::QUICK;

    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn update(&self) -> u64 {
        self.update
    }

    fn steps(&self) -> u64 {
        self.steps
    }

    /// Fills the memory first, then flies as many slots per update as the settings say.
    fn advance(&mut self) -> Result<L::Losses, TrainError> {
        while self.replay.len() < self.settings.warm_up.min(self.settings.replay) {
            self.fly(true)?;
        }
        self.fly(false)?;
        let transitions = self.replay.sample(self.settings.batch, &mut self.rng);
        let preferences: Vec<_> = (0..self.settings.batch * self.settings.preferences)
            .map(|_| {
                // The corners are a null set of the uniform distribution, and what operators use most.
                match self.rng.random_range(0..20) {
                    0 => gleaner_policy::Preference::DATA,
                    1 => gleaner_policy::Preference::ENERGY,
                    _ => random_preference(&mut self.rng),
                }
            })
            .collect();
        let losses =
            self.learner.update(&self.encoding, &self.settings, self.update, &transitions, &preferences);
        self.update += 1;
        // A plain mean at first, so that the untrained start is soon forgotten.
        let share = AVERAGING.max(1.0 / self.update as f32);
        net::polyak(&mut self.averaged, self.learner.deciding(), share);
        Ok(losses)
    }

    fn validate(&mut self, best: &mut Option<Learned>) -> Result<Tables, TrainError> {
        let tables = self.validation.tables(&self.world, &mut Trained::<L>::new(&self.averaged))?;
        Learned { score: tables.score(), ..self.last() }.offer(best);
        Ok(tables)
    }

    /// Writes the averaged network as it stands to [`LAST`], too.
    fn save(&mut self, folder: &Path) -> Result<(), CheckpointError> {
        let stored = Stored {
            settings: &self.settings,
            learner: &self.learner,
            replay: &self.replay,
            flights: self.flights.iter().map(|going| (going.mission, going.actions.clone())).collect(),
            next_mission: self.next_mission,
            rng_seed: self.rng.get_seed(),
            rng_word: self.rng.get_word_pos(),
            update: self.update,
            steps: self.steps,
            averaged: self.averaged.clone(),
        };
        checkpoint::save_named(&folder.join(CHECKPOINT), L::SYSTEM.name(), &stored)?;
        self.last().save_in(&folder.join(LAST))
    }
}

/// The command that trains a system, without its settings.
fn method(system: System) -> String {
    if system == System::default() { "train".into() } else { format!("train --system {system}") }
}
