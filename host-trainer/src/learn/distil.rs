//! Distillation: the actor imitates a teacher from its own observations.
//!
//! The teacher ([`Teaching`]) is a planner with full knowledge, the look-ahead that flies, which knows what the student is
//! told, or an ensemble of trained policies (mentors), each evaluated in the eight views of the state. The errors of a
//! network differ from view to view, so the mean of its logits is better than each of them, and a student of the mean keeps
//! the gain (ensemble distillation: Hinton, Vinyals and Dean 2015).
//!
//! The student flies and the teacher labels every state (DAgger: Ross, Gordon and Bagnell 2011), so that the student is
//! trained on the states that it visits. Each example is used in a random view. The loss is the cross entropy between the
//! teacher's distribution and the masked policy.

use crate::env::distribution::{ACTIONS, Distribution};
use crate::env::flight::Flight;
use crate::env::site::Site;
use crate::judge::evaluation::Network;
use crate::judge::validation::{Tables, Validation};
use crate::keep::checkpoint::CheckpointError;
use crate::keep::snapshot::{LAST, Snapshot};
use crate::learn::resume;
use crate::learn::teaching::Lessons;
use crate::learn::trainer::{Pace, TrainError, Trainer};
use crate::net::{self, Adam, Batch, Sample, Shape, Workspace};
use crate::observe::Encoding;
use crate::observe::tokens::{Observation, PolicyTokens};
use crate::planner::teacher::Teacher;
use crate::settings::Settings;
use gleaner_policy::{Preference, View};
use gleaner_units::{Action, ActionMask};
use gleaner_world::ScenarioKind;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;
use std::path::Path;

pub use crate::learn::teaching::Teaching;

/// File name of the checkpoint inside the output folder.
pub const CHECKPOINT: &str = "distil.checkpoint";
/// Name in the checkpoint.
const NAME: &str = "distil";

/// Hyper-parameters that the command line does not set. Source of all: trials on the default city.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistilSettings {
    /// Flights in parallel: 16.
    pub flights: usize,
    /// Examples before the first update: 2,000.
    pub warm_up: usize,
    /// Updates over which the share of slots that the student flies rises from 0: 2,000.
    pub hand_over: u64,
    /// Largest share of the slots that the student flies: 0.9.
    pub student_share: f64,
    /// Capacity of the memory of the shortest mission, examples: 4,000.
    pub shortest_kept: usize,
    /// One in this number of a batch's examples is of the shortest mission: 4.
    pub shortest_every: usize,
    /// Step size of the running average of the actor, per update: 0.001.
    pub averaging: f32,
}

impl DistilSettings {
    /// The values that trained the shipped policy.
    pub const DEFAULT: DistilSettings = DistilSettings {
        flights: 16,
        warm_up: 2_000,
        hand_over: 2_000,
        student_share: 0.9,
        shortest_kept: 4_000,
        shortest_every: 4,
        averaging: 0.001,
    };
}

/// A state with the teacher's distribution.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Example {
    state: Observation,
    preference: Preference,
    mask: ActionMask,
    /// Probability of each action.
    target: [f32; ACTIONS],
}

/// The loss of an update.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CrossEntropy {
    /// Between the teacher's distribution and the masked policy, nats.
    pub cross_entropy: f32,
}

impl fmt::Display for CrossEntropy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cross entropy {:.4}", self.cross_entropy)
    }
}

/// A run of distillation.
pub struct Distillation {
    method: String,
    settings: Settings,
    constants: DistilSettings,
    site: Site,
    planner: Teacher,
    teaching: Teaching,
    flights: Vec<(Flight, Lessons)>,
    shortest: VecDeque<Example>,
    stored: Stored,
    gradients: Vec<f32>,
    batch: Batch,
    workspace: Workspace,
    rng: ChaCha8Rng,
    validation: Validation,
}

/// The checkpoint after the settings; the field order is the file format. The current flights and the examples of the
/// shortest mission are not in it: they start again.
#[derive(Serialize, Deserialize)]
struct Stored {
    actor: Vec<f32>,
    averaged: Vec<f32>,
    adam: Adam,
    examples: Vec<Example>,
    next_example: usize,
    next_mission: u64,
    update: u64,
    steps: u64,
    rng_word: u128,
}

impl Distillation {
    /// Continues from the checkpoint in `folder`, or starts with the actor of `from` if given.
    ///
    /// # Errors
    /// The checkpoint is damaged or of another run; no mission could be drawn.
    pub fn open(
        settings: Settings,
        site: Site,
        folder: &Path,
        from: Option<&Snapshot>,
        teaching: Teaching,
    ) -> Result<Distillation, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let stored = match resume::load::<Stored>(&folder.join(CHECKPOINT), NAME, &settings)? {
            Some(stored) => {
                rng.set_word_pos(stored.rng_word);
                stored
            }
            None => Stored::start(from, &mut rng),
        };
        let mut run = Distillation {
            planner: Teacher::new(site.world().clone()),
            validation: Validation::draw(&site, &settings)?,
            method: teaching.method(from),
            constants: DistilSettings::DEFAULT,
            teaching,
            settings,
            site,
            flights: Vec::new(),
            shortest: VecDeque::new(),
            stored,
            gradients: Vec::new(),
            batch: Batch::new(),
            workspace: Workspace::new(),
            rng,
        };
        for index in 0..run.constants.flights {
            let flight = run.next_flight(index)?;
            run.flights.push(flight);
        }
        Ok(run)
    }

    /// Flight 0 is always the mission out and back for energy alone. It lasts two slots, so the examples of drawn
    /// missions would hardly contain it, and it must be flown without an error.
    fn next_flight(&mut self, index: usize) -> Result<(Flight, Lessons), TrainError> {
        let mut mission = self.settings.missions().mission(&self.site, self.stored.next_mission)?;
        self.stored.next_mission += 1;
        if index == 0 && self.settings.share_rb > 0.0 {
            let scenario = self.site.scenario(ScenarioKind::ReturnBase);
            mission.realization = self.site.realization(&scenario, mission.seed)?;
            mission.preference = Preference::ENERGY;
        }
        let flight = Flight::new(self.site.world(), &mission.realization, mission.seed, mission.preference)?
            .with_table(self.site.table());
        let lessons =
            self.teaching.begin(&flight, &mission.realization, &self.planner, self.stored.next_mission);
        Ok((flight, lessons))
    }

    /// One slot of every flight: the teacher labels the state; the student, or at first the teacher, flies.
    fn collect(&mut self) -> Result<(), TrainError> {
        let states: Vec<Observation> =
            self.flights.iter().map(|(flight, _)| Observation::new(&flight.tokens())).collect();
        let inputs: Vec<Sample> = (self.flights.iter().zip(&states))
            .map(|((flight, _), state)| state.with(flight.preference()))
            .collect();
        let logits = Network::new(Shape::actor(), &self.stored.actor).logits(inputs.iter().copied());
        let mentors = self.mentor_logits(&inputs);
        let progress = self.stored.update as f64 / self.constants.hand_over as f64;
        let student_share = progress.min(self.constants.student_share);
        for (index, (state, logits)) in states.into_iter().zip(logits).enumerate() {
            let (flight, lessons) = &mut self.flights[index];
            let (mask, preference) = (flight.mask(), flight.preference());
            let (advice, target) = lessons.label(flight, mentors.get(index).unwrap_or(&logits))?;
            // The student acts as on board, so that the states are those of the finished policy.
            let own = mask.argmax(&logits).unwrap_or(advice);
            let action = if self.rng.random_bool(student_share) { own } else { advice };
            flight.step(action);
            let is_over = flight.is_over();
            self.stored.steps += 1;
            self.remember(index, Example { state, preference, mask, target });
            if is_over {
                self.flights[index] = self.next_flight(index)?;
            }
        }
        Ok(())
    }

    fn remember(&mut self, flight: usize, example: Example) {
        if flight == 0 {
            self.shortest.truncate(self.constants.shortest_kept - 1);
            self.shortest.push_front(example.clone());
        }
        if self.stored.examples.len() < self.settings.replay {
            self.stored.examples.push(example);
        } else {
            self.stored.examples[self.stored.next_example] = example;
        }
        self.stored.next_example = (self.stored.next_example + 1) % self.settings.replay;
    }

    /// Mean logits of all mentors in all views; empty without mentors.
    fn mentor_logits(&self, inputs: &[Sample]) -> Vec<[f32; ACTIONS]> {
        let Teaching::Mentors(mentors) = &self.teaching else { return Vec::new() };
        let Some((first, others)) = mentors.split_first() else { return Vec::new() };
        let logits = |mentor: &Snapshot| Network::new(Shape::actor(), &mentor.actor).averaged_logits(inputs);
        let mut mean = logits(first);
        for mentor in others {
            for (sum, logit) in mean.as_flattened_mut().iter_mut().zip(logits(mentor).as_flattened()) {
                *sum += logit;
            }
        }
        let share = 1.0 / mentors.len() as f32;
        mean.as_flattened_mut().iter_mut().for_each(|logit| *logit *= share);
        mean
    }

    /// One gradient step; returns the cross entropy.
    fn learn(&mut self) -> f32 {
        let count = self.settings.batch * self.settings.preferences;
        let examples: Vec<&Example> = (0..count)
            .map(|index| {
                if index % self.constants.shortest_every == 0 {
                    &self.shortest[self.rng.random_range(0..self.shortest.len())]
                } else {
                    &self.stored.examples[self.rng.random_range(0..self.stored.examples.len())]
                }
            })
            .collect();
        let views: Vec<View> =
            examples.iter().map(|_| View::ALL[self.rng.random_range(0..View::ALL.len())]).collect();
        self.batch.clear();
        for (example, &view) in examples.iter().zip(&views) {
            self.batch.push_sample(&example.state.with(example.preference).seen(view));
        }
        self.gradients.clear();
        self.gradients.resize(self.stored.actor.len(), 0.0);
        let scale = 1.0 / count as f32;
        let mut loss = 0.0;
        net::forward_backward(
            &Shape::actor(),
            &self.stored.actor,
            &self.batch,
            &mut self.workspace,
            |range, outputs, gradients| {
                let rows =
                    outputs.as_chunks::<ACTIONS>().0.iter().zip(gradients.as_chunks_mut::<ACTIONS>().0);
                let labelled = examples[range.clone()].iter().zip(&views[range]);
                for ((logits, gradients), (example, view)) in rows.zip(labelled) {
                    let unturned = Action::ALL.map(|action| logits[view.action(action).index()]);
                    let policy = Distribution::new(&unturned, example.mask);
                    for action in Action::ALL {
                        let (index, target) = (action.index(), example.target[action.index()]);
                        loss -= scale * target * policy.log_probability[index];
                        gradients[view.action(action).index()] = scale * (policy.probability[index] - target);
                    }
                }
            },
            &mut self.gradients,
        );
        self.stored.adam.lr = self.settings.learning_rate_at(self.stored.update);
        self.stored.adam.step(&mut self.stored.actor, &self.gradients);
        loss
    }

    /// The averaged policy as it is now.
    fn snapshot(&self) -> Snapshot {
        Snapshot {
            system: PolicyTokens::MOSAC_NAME.to_owned(),
            method: self.method.clone(),
            settings: self.settings.clone(),
            actor: self.stored.averaged.clone(),
            update: self.stored.update,
            steps: self.stored.steps,
            score: f64::NEG_INFINITY,
        }
    }
}

impl Stored {
    fn start(from: Option<&Snapshot>, rng: &mut ChaCha8Rng) -> Stored {
        let initial = Shape::actor().initialise(rng);
        let actor = from.map_or(initial, |snapshot| snapshot.actor.clone());
        Stored {
            averaged: actor.clone(),
            adam: Adam::new(actor.len(), 0.0),
            actor,
            examples: Vec::new(),
            next_example: 0,
            next_mission: 0,
            update: 0,
            steps: from.map_or(0, |snapshot| snapshot.steps),
            rng_word: 0,
        }
    }
}

impl Trainer for Distillation {
    type Losses = CrossEntropy;
    const PACE: Pace = Pace::FAST;

    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn update(&self) -> u64 {
        self.stored.update
    }

    fn steps(&self) -> u64 {
        self.stored.steps
    }

    /// Collects examples when they are due, in rounds of all flights, and makes one update.
    fn advance(&mut self) -> Result<CrossEntropy, TrainError> {
        while self.stored.examples.len() < self.constants.warm_up.min(self.settings.replay)
            || self.shortest.is_empty()
        {
            self.collect()?;
        }
        let every = (self.constants.flights / self.settings.steps_per_update).max(1);
        if self.stored.update.is_multiple_of(every as u64) {
            self.collect()?;
        }
        let cross_entropy = self.learn();
        self.stored.update += 1;
        // A plain mean at first, so that the initial parameters soon have no weight.
        let share = self.constants.averaging.max(1.0 / self.stored.update as f32);
        net::polyak(&mut self.stored.averaged, &self.stored.actor, share);
        Ok(CrossEntropy { cross_entropy })
    }

    fn validate(&mut self, best: &mut Option<Snapshot>) -> Result<Tables, TrainError> {
        let tables = self.validation.judge(self.site.world(), &self.stored.averaged)?;
        Snapshot { score: tables.score(), ..self.snapshot() }.offer(best);
        Ok(tables)
    }

    fn save(&mut self, folder: &Path) -> Result<(), CheckpointError> {
        self.stored.rng_word = self.rng.get_word_pos();
        resume::save(&folder.join(CHECKPOINT), NAME, &self.settings, &self.stored)?;
        self.snapshot().save(&folder.join(LAST))
    }
}
