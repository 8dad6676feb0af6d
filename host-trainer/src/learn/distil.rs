//! Distillation: the actor learns to do what a teacher would do, from what it can see itself.
//!
//! The teacher is a planner that knows everything; or mentors, policies that have been learned already, each asked in
//! the eight views of the situation. What a network has learned by accident differs from view to view, so the mean
//! of its answers is better than each, and a pupil that learns the mean keeps what is better (as ensembles do: Hinton,
//! Vinyals and Dean 2015).
//!
//! The learner flies and the teacher says at every slot what it would have done (DAgger: Ross, Gordon and Bagnell
//! 2011), so the learner is taught in the states that it gets itself into. It sees each lesson in a view drawn at
//! random. The loss is the cross entropy of the teacher's distribution under the masked policy.

use crate::env::flight::Flight;
use crate::judge::evaluation::{DeciderError, Network};
use crate::keep::checkpoint::{self, CheckpointError};
use crate::learn::learning::{Learning, Pace};
use crate::learn::mosac::Distribution;
use crate::learn::run::{Learned, Tables, TrainError, Validation};
use crate::learn::settings::Settings;
use crate::net::{self, Adam, Batch, Sample, Shape, Workspace};
use crate::observe::tokens::Observation;
use crate::planner::teacher::{Course, Teacher};
use crate::systems::System;
use gleaner_policy::{Preference, View};
use gleaner_units::{Action, ActionMask};
use gleaner_world::{Realization, ScenarioKind, World};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// The checkpoint's name inside the output folder.
pub const CHECKPOINT: &str = "distil.checkpoint";
/// Missions in the air at once.
const FLIGHTS: usize = 16;
/// Lessons before the first update.
const WARM_UP: usize = 2_000;
/// Updates over which the teacher hands the controls to the learner.
const HAND_OVER: u64 = 2_000;
/// Lessons of the shortest mission that are kept, and how often one of them is in a batch.
const SHORTEST_KEPT: usize = 4_000;
const SHORTEST_EVERY: usize = 4;
/// Share of the actor that its running average takes over per update.
const AVERAGING: f32 = 0.001;

/// A state and what the teacher would do in it.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Lesson {
    seen: Observation,
    preference: Preference,
    mask: ActionMask,
    /// Probability of each action.
    taught: [f32; Action::COUNT],
}

/// What an update tells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CrossEntropy {
    /// Of the teacher's distribution under the masked policy, nats.
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
    world: Arc<World>,
    teacher: Teacher,
    /// Those who teach instead of the planner, if there are any.
    mentors: Vec<Learned>,
    flights: Vec<(Flight, Course)>,
    shortest: VecDeque<Lesson>,
    kept: Kept,
    gradients: Vec<f32>,
    batch: Batch,
    workspace: Workspace,
    rng: ChaCha8Rng,
    validation: Validation,
}

fn not_a_number() -> DeciderError {
    DeciderError("a mentor's answer is not a number".into())
}

/// The command line that comes here, from the first one on.
fn method(from: Option<&Learned>, mentors: &[Learned]) -> String {
    let whole = |learned: &Learned, out: &str| {
        learned.settings.command_line(&learned.method, out).trim_start_matches("gleaner-train ").to_owned()
    };
    let mut method = from.map_or("distil".to_owned(), |from| {
        format!("{} && gleaner-train distil --from FIRST", whole(from, "FIRST"))
    });
    for (index, mentor) in mentors.iter().enumerate() {
        if from.is_some_and(|from| from.actor == mentor.actor) {
            method += " --mentor FIRST";
        } else {
            let name = format!("MENTOR{index}");
            method = format!("{} && gleaner-train {method} --mentor {name}", whole(mentor, &name));
        }
    }
    method
}

/// What the checkpoint keeps. Flights in the air, and the lessons of the shortest mission, begin anew after a kill.
#[derive(Serialize, Deserialize)]
struct Kept {
    settings: Settings,
    actor: Vec<f32>,
    averaged: Vec<f32>,
    adam: Adam,
    lessons: Vec<Lesson>,
    next_lesson: usize,
    next_mission: u64,
    update: u64,
    steps: u64,
    rng_word: u128,
}

impl Distillation {
    /// Goes on from the checkpoint in `folder`, or starts anew, with the actor of `from` if there is one. Mentors take
    /// the place of the planner.
    ///
    /// # Errors
    /// The checkpoint is damaged or of another run; no mission could be drawn.
    pub fn open(
        settings: Settings,
        folder: &Path,
        from: Option<&Learned>,
        mentors: Vec<Learned>,
    ) -> Result<Distillation, TrainError> {
        let path = folder.join(CHECKPOINT);
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let kept = if path.exists() {
            let mut kept: Kept = checkpoint::load(&path)?;
            // A finished run may be prolonged.
            kept.settings.updates = settings.updates;
            if kept.settings != settings {
                return Err(TrainError::OtherSettings { path });
            }
            rng.set_word_pos(kept.rng_word);
            kept
        } else {
            let fresh = Shape::actor().initialise(&mut rng);
            let actor = from.map_or(fresh, |learned| learned.actor.clone());
            Kept {
                averaged: actor.clone(),
                adam: Adam::new(actor.len(), 0.0),
                actor,
                lessons: Vec::new(),
                next_lesson: 0,
                next_mission: 0,
                update: 0,
                steps: from.map_or(0, |learned| learned.steps),
                rng_word: 0,
                settings: settings.clone(),
            }
        };
        let world = Arc::new(World::default_world());
        let mut run = Distillation {
            teacher: Teacher::new(Arc::clone(&world)),
            validation: Validation::draw(&world, &settings)?,
            method: method(from, &mentors),
            mentors,
            settings,
            world,
            flights: Vec::new(),
            shortest: VecDeque::new(),
            kept,
            gradients: Vec::new(),
            batch: Batch::new(),
            workspace: Workspace::new(),
            rng,
        };
        for index in 0..FLIGHTS {
            let flight = run.next_flight(index)?;
            run.flights.push(flight);
        }
        Ok(run)
    }

    /// The first of the flights is always out and back for energy alone. It lasts two slots, so among the lessons of
    /// drawn missions it would hardly be seen, and it must be flown exactly: its lessons are kept apart.
    fn next_flight(&mut self, index: usize) -> Result<(Flight, Course), TrainError> {
        let mut mission = self.settings.mission(&self.world, self.kept.next_mission)?;
        self.kept.next_mission += 1;
        if index == 0 && self.settings.share_rb > 0.0 {
            let scenario = ScenarioKind::ReturnBase.scenario();
            mission.realization = Realization::draw(self.world.city(), &scenario, mission.seed)?;
            mission.preference = Preference::ENERGY;
        }
        let flight = Flight::new(&self.world, &mission.realization, mission.seed, mission.preference)?;
        Ok((flight, self.teacher.study(&mission.realization)))
    }

    /// Every flight is shown to the teacher; the learner, or at first the teacher, decides.
    fn fly(&mut self) -> Result<(), TrainError> {
        let seen: Vec<Observation> = self.flights.iter().map(|(flight, _)| flight.observe()).collect();
        let inputs = self.flights.iter().zip(&seen).map(|((flight, _), seen)| seen.with(flight.preference()));
        let inputs: Vec<Sample> = inputs.collect();
        let logits = Network::new(Shape::actor(), &self.kept.actor).logits(inputs.iter().copied());
        let mentored = self.mentored(&inputs);
        let learner_flies = (self.kept.update as f64 / HAND_OVER as f64).min(0.9);
        for (index, (seen, logits)) in seen.into_iter().zip(logits).enumerate() {
            let (flight, known) = &mut self.flights[index];
            let (mask, preference) = (flight.mask(), flight.preference());
            let (advice, taught) = match mentored.get(index) {
                None => known.teach(flight),
                Some(logits) => {
                    let advice = mask.argmax(logits).ok_or_else(not_a_number)?;
                    (advice, Distribution::new(logits, mask).probability)
                }
            };
            // As on board: the states to be taught in are those that the finished policy will see.
            let own = mask.argmax(&logits).unwrap_or(advice);
            let action = if self.rng.random_bool(learner_flies) { own } else { advice };
            flight.step(action);
            self.kept.steps += 1;
            let lesson = Lesson { seen, preference, mask, taught };
            if index == 0 {
                self.shortest.truncate(SHORTEST_KEPT - 1);
                self.shortest.push_front(lesson.clone());
            }
            if self.kept.lessons.len() < self.settings.replay {
                self.kept.lessons.push(lesson);
            } else {
                self.kept.lessons[self.kept.next_lesson] = lesson;
            }
            self.kept.next_lesson = (self.kept.next_lesson + 1) % self.settings.replay;
            if flight.is_over() {
                self.flights[index] = self.next_flight(index)?;
            }
        }
        Ok(())
    }

    /// The mean logits of all mentors in all views; nothing without mentors.
    fn mentored(&self, inputs: &[Sample]) -> Vec<[f32; Action::COUNT]> {
        let answers = self
            .mentors
            .iter()
            .map(|mentor| Network::new(Shape::actor(), &mentor.actor).averaged_logits(inputs));
        let share = 1.0 / self.mentors.len().max(1) as f32;
        answers
            .reduce(|mut sums, answers| {
                for (sum, answer) in sums.as_flattened_mut().iter_mut().zip(answers.as_flattened()) {
                    *sum += answer;
                }
                sums
            })
            .map(|mut sums| {
                sums.as_flattened_mut().iter_mut().for_each(|logit| *logit *= share);
                sums
            })
            .unwrap_or_default()
    }

    fn learn(&mut self) -> f32 {
        let count = self.settings.batch * self.settings.preferences;
        let lessons: Vec<&Lesson> = (0..count)
            .map(|index| {
                if index % SHORTEST_EVERY == 0 {
                    &self.shortest[self.rng.random_range(0..self.shortest.len())]
                } else {
                    &self.kept.lessons[self.rng.random_range(0..self.kept.lessons.len())]
                }
            })
            .collect();
        let views: Vec<View> =
            lessons.iter().map(|_| View::ALL[self.rng.random_range(0..View::ALL.len())]).collect();
        self.batch.clear();
        for (lesson, &view) in lessons.iter().zip(&views) {
            self.batch.push_sample(&lesson.seen.with(lesson.preference).seen(view));
        }
        self.gradients.clear();
        self.gradients.resize(self.kept.actor.len(), 0.0);
        let scale = 1.0 / count as f32;
        let mut loss = 0.0;
        net::forward_backward(
            &Shape::actor(),
            &self.kept.actor,
            &self.batch,
            &mut self.workspace,
            |range, outputs, gradients| {
                let rows = outputs.as_chunks::<5>().0.iter().zip(gradients.as_chunks_mut::<5>().0);
                let seen = lessons[range.clone()].iter().zip(&views[range]);
                for ((logits, gradients), (lesson, view)) in rows.zip(seen) {
                    let plain = Action::ALL.map(|action| logits[view.action(action).index()]);
                    let policy = Distribution::new(&plain, lesson.mask);
                    for action in Action::ALL {
                        let (index, taught) = (action.index(), lesson.taught[action.index()]);
                        loss -= scale * taught * policy.log_probability[index];
                        gradients[view.action(action).index()] = scale * (policy.probability[index] - taught);
                    }
                }
            },
            &mut self.gradients,
        );
        self.kept.adam.lr = self.settings.learning_rate_at(self.kept.update);
        self.kept.adam.step(&mut self.kept.actor, &self.gradients);
        loss
    }
}

impl Learning for Distillation {
    type Losses = CrossEntropy;
    const PACE: Pace = Pace::QUICK;

    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn update(&self) -> u64 {
        self.kept.update
    }

    fn steps(&self) -> u64 {
        self.kept.steps
    }

    /// Flies one slot of every flight if lessons are due.
    fn advance(&mut self) -> Result<CrossEntropy, TrainError> {
        while self.kept.lessons.len() < WARM_UP || self.shortest.is_empty() {
            self.fly()?;
        }
        // As many slots per update as the settings say, in rounds of all flights.
        let every = (FLIGHTS / self.settings.steps_per_update).max(1);
        if self.kept.update.is_multiple_of(every as u64) {
            self.fly()?;
        }
        let cross_entropy = self.learn();
        self.kept.update += 1;
        let share = AVERAGING.max(1.0 / self.kept.update as f32);
        net::polyak(&mut self.kept.averaged, &self.kept.actor, share);
        Ok(CrossEntropy { cross_entropy })
    }

    fn validate(&mut self, best: &mut Option<Learned>) -> Result<Tables, TrainError> {
        let candidate = Learned {
            system: System::Gleaner,
            method: self.method.clone(),
            settings: self.settings.clone(),
            actor: self.kept.averaged.clone(),
            update: self.kept.update,
            steps: self.kept.steps,
            score: f64::NEG_INFINITY,
        };
        Ok(self.validation.examine(&self.world, candidate, best)?)
    }

    fn save(&mut self, folder: &Path) -> Result<(), CheckpointError> {
        self.kept.rng_word = self.rng.get_word_pos();
        checkpoint::save(&folder.join(CHECKPOINT), &self.kept)
    }
}
