//! The training loop, read top to bottom.

use crate::checkpoint::{self, CheckpointError};
use crate::evaluation::{DeciderError, Network, Table, evaluate};
use crate::flight::{Flight, Reward};
use crate::greedy::Greedy;
use crate::mosac::{Distribution, Learner, Losses, Rates};
use crate::net::{self, Shape};
use crate::replay::{Replay, Transition};
use crate::settings::{Settings, random_preference};
use gleaner_units::Action;
use gleaner_world::{Realization, ScenarioError, ScenarioKind, Seed, World};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// The checkpoint's name inside the output folder.
pub const CHECKPOINT: &str = "run.checkpoint";
/// The best parameters' name inside the output folder.
pub const LEARNED: &str = "learned.checkpoint";
/// The learning curve's name inside the output folder: one JSON object a line.
pub const CURVE: &str = "curve.jsonl";
/// Realizations that choose the best parameters have numbers from here on; those that judge count from 0.
const VALIDATION_FROM: u64 = 10_000;
const VALIDATION_COUNT: u64 = 60;
/// Share of the actor that its running average takes over per update. The average is what is judged and shipped:
/// single updates are noisy, and the noise does not fly. It does not act back on the training.
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
}

/// What a run tells while it goes on: one line of the learning curve.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Progress<L> {
    /// Updates done.
    pub update: u64,
    /// Slots flown.
    pub steps: u64,
    /// Of the last update.
    pub losses: L,
    /// On the validation realizations.
    pub tables: Tables,
}

/// Per scenario that is trained: name and validation table.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Tables(pub Vec<(String, Table)>);

impl Tables {
    /// What the best parameters are chosen by: the mean hypervolume over the scenarios.
    #[must_use]
    pub fn score(&self) -> f64 {
        self.0.iter().map(|(_, table)| table.hypervolume).sum::<f64>() / self.0.len().max(1) as f64
    }
}

/// The realizations that choose the best parameters: other ones than those that are trained on and those that judge.
#[derive(Clone, Debug)]
pub struct Validation(Vec<(ScenarioKind, Vec<(Seed, Realization)>)>);

impl Validation {
    /// Those of the scenarios that the settings train.
    ///
    /// # Errors
    /// The scenario does not fit the city.
    pub fn draw(world: &World, settings: &Settings) -> Result<Validation, ScenarioError> {
        let shares = [settings.share_rd, settings.share_rb];
        let trained = ScenarioKind::ALL.into_iter().zip(shares).filter(|(_, share)| *share > 0.0);
        trained
            .map(|(kind, _)| {
                let numbers = VALIDATION_FROM..VALIDATION_FROM + VALIDATION_COUNT;
                let drawn = numbers.map(|number| {
                    let seed = Seed::evaluation(number);
                    Ok((seed, Realization::draw(world.city(), &kind.scenario(), seed)?))
                });
                Ok((kind, drawn.collect::<Result<_, ScenarioError>>()?))
            })
            .collect::<Result<_, _>>()
            .map(Validation)
    }

    /// The paper's metrics of an actor on them.
    ///
    /// # Errors
    /// The network's answer is not a number: the run diverged.
    pub fn judge(&self, world: &Arc<World>, actor: &[f32]) -> Result<Tables, DeciderError> {
        let table = |(kind, realizations): &(ScenarioKind, Vec<(Seed, Realization)>)| {
            let mut network = Network::new(Shape::actor(), actor);
            Ok((kind.name().to_owned(), evaluate(world, realizations, &mut network)?))
        };
        self.0.iter().map(table).collect::<Result<_, _>>().map(Tables)
    }
}

/// The best parameters of a run by validation, and how they came about: what `evaluate` and `export` read.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Learned {
    /// The command that made them: `train` or `distil`.
    pub method: String,
    /// Its settings.
    pub settings: Settings,
    /// The actor.
    pub actor: Vec<f32>,
    /// Update at which it was found.
    pub update: u64,
    /// Slots flown until then.
    pub steps: u64,
    /// Mean hypervolume on the validation realizations.
    pub score: f64,
}

impl Learned {
    /// Reads what a run in `folder` has learned so far; `None` before its first validation.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn load(folder: &Path) -> Result<Option<Learned>, CheckpointError> {
        let path = folder.join(LEARNED);
        if path.exists() { checkpoint::load(&path).map(Some) } else { Ok(None) }
    }

    /// Writes it.
    ///
    /// # Errors
    /// The disk; the last good file is then still there.
    pub fn save(&self, folder: &Path) -> Result<(), CheckpointError> {
        checkpoint::save(&folder.join(LEARNED), self)
    }
}

/// A run: everything that the next update depends on.
pub struct Run {
    settings: Settings,
    world: Arc<World>,
    learner: Learner,
    replay: Replay,
    flights: Vec<Going>,
    next_mission: u64,
    rng: ChaCha8Rng,
    update: u64,
    steps: u64,
    averaged_actor: Vec<f32>,
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

#[derive(Serialize, Deserialize)]
struct Stored {
    settings: Settings,
    learner: Learner,
    replay: Replay,
    flights: Vec<(u64, Vec<u8>)>,
    next_mission: u64,
    rng_seed: [u8; 32],
    rng_word: u128,
    update: u64,
    steps: u64,
    averaged_actor: Vec<f32>,
}

impl Run {
    /// Goes on from the checkpoint in `folder`, or starts a new run when there is none.
    ///
    /// # Errors
    /// See [`TrainError`].
    pub fn open(settings: Settings, folder: &Path) -> Result<Run, TrainError> {
        let path = folder.join(CHECKPOINT);
        if !path.exists() {
            return Run::new(settings);
        }
        let stored: Stored = checkpoint::load(&path)?;
        // A finished run may be prolonged.
        if (Settings { updates: settings.updates, ..stored.settings.clone() }) != settings {
            return Err(TrainError::OtherSettings { path });
        }
        Run::restore(settings, stored)
    }

    fn new(settings: Settings) -> Result<Run, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let learner = Learner::new(&settings, &mut rng);
        let mut run = Run::assemble(settings, learner, rng)?;
        for _ in 0..run.settings.steps_per_update {
            let going = run.next_flight()?;
            run.flights.push(going);
        }
        Ok(run)
    }

    fn restore(settings: Settings, stored: Stored) -> Result<Run, TrainError> {
        let mut rng = ChaCha8Rng::from_seed(stored.rng_seed);
        rng.set_word_pos(stored.rng_word);
        let mut run = Run::assemble(settings, stored.learner, rng)?;
        run.replay = stored.replay;
        run.next_mission = stored.next_mission;
        run.update = stored.update;
        run.steps = stored.steps;
        run.averaged_actor = stored.averaged_actor;
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

    fn assemble(settings: Settings, learner: Learner, rng: ChaCha8Rng) -> Result<Run, TrainError> {
        let world = Arc::new(World::default_world());
        let validation = Validation::draw(&world, &settings)?;
        Ok(Run {
            replay: Replay::new(settings.replay),
            settings,
            world,
            averaged_actor: learner.actor().to_vec(),
            learner,
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

    fn next_flight(&mut self) -> Result<Going, ScenarioError> {
        let mission = self.next_mission;
        self.next_mission += 1;
        self.begin(mission)
    }

    /// Updates done.
    #[must_use]
    pub const fn update(&self) -> u64 {
        self.update
    }

    /// Whether the settings ask for no more updates.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        self.update >= self.settings.updates
    }

    /// One update of the networks, after as many slots as the settings say. Fills the memory first.
    ///
    /// # Errors
    /// No mission could be drawn.
    pub fn advance(&mut self) -> Result<Losses, TrainError> {
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
        let annealed = self.settings.annealed(self.update);
        let rates = Rates {
            learning_rate: self.settings.learning_rate_at(self.update),
            entropy_target: mix(self.settings.entropy_start, self.settings.entropy_end, annealed),
        };
        let losses = self.learner.update(&self.settings, rates, &transitions, &preferences);
        self.update += 1;
        // A plain mean at first, so that the untrained start is soon forgotten.
        let share = AVERAGING.max(1.0 / self.update as f32);
        net::polyak(&mut self.averaged_actor, self.learner.actor(), share);
        Ok(losses)
    }

    /// One slot of every flight, explored with the heated softmax (paper, eq. 20).
    fn fly(&mut self, uniform: bool) -> Result<(), TrainError> {
        let heat = mix(self.settings.heat_start, self.settings.heat_end, self.settings.annealed(self.update));
        let observations: Vec<_> = self.flights.iter().map(|going| going.flight.observe()).collect();
        let logits = Network::new(Shape::actor(), self.learner.actor()).logits(
            self.flights.iter().zip(&observations).map(|(going, seen)| seen.with(going.flight.preference())),
        );
        for (index, (before, logits)) in observations.into_iter().zip(logits).enumerate() {
            let going = &mut self.flights[index];
            let mask_before = going.flight.mask();
            let heated = if uniform { [0.0; Action::COUNT] } else { logits.map(|logit| logit / heat) };
            let explored = Distribution::new(&heated, mask_before).pick(self.rng.random());
            let guided = !uniform && self.rng.random_bool(0.9);
            let action = going.advice().filter(|_| guided).unwrap_or(explored);
            let reward = going.step(action);
            let over = going.flight.is_over();
            let (after, mask_after) = (going.flight.observe(), going.flight.mask());
            self.replay.push(Transition { before, mask_before, action, reward, after, mask_after, over });
            self.steps += 1;
            if over {
                self.flights[index] = self.next_flight()?;
            }
        }
        Ok(())
    }

    /// Judges the averaged actor on the validation realizations, and puts it into `best` if it is better.
    ///
    /// # Errors
    /// The network's answer is not a number: the run diverged.
    pub fn validate(
        &self,
        losses: Losses,
        best: &mut Option<Learned>,
    ) -> Result<Progress<Losses>, TrainError> {
        let tables = self.validation.judge(&self.world, &self.averaged_actor)?;
        let score = tables.score();
        if best.as_ref().is_none_or(|best| score > best.score) {
            *best = Some(Learned {
                method: "train".into(),
                settings: self.settings.clone(),
                actor: self.averaged_actor.clone(),
                update: self.update,
                steps: self.steps,
                score,
            });
        }
        Ok(Progress { update: self.update, steps: self.steps, losses, tables })
    }

    /// Writes everything that the next update depends on.
    ///
    /// # Errors
    /// The disk; the last good checkpoint is then still there.
    pub fn save(&self, folder: &Path) -> Result<(), TrainError> {
        let stored = Stored {
            settings: self.settings.clone(),
            learner: self.learner.clone(),
            replay: self.replay.clone(),
            flights: self.flights.iter().map(|going| (going.mission, going.actions.clone())).collect(),
            next_mission: self.next_mission,
            rng_seed: self.rng.get_seed(),
            rng_word: self.rng.get_word_pos(),
            update: self.update,
            steps: self.steps,
            averaged_actor: self.averaged_actor.clone(),
        };
        Ok(checkpoint::save(&folder.join(CHECKPOINT), &stored)?)
    }
}

fn mix(start: f32, end: f32, progress: f32) -> f32 {
    start + (end - start) * progress
}
