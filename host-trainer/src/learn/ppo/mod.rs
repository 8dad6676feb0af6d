//! Refinement: a policy that has been taught goes on to learn from its own flights.
//!
//! The teacher knows what the aircraft does not, so even the best pupil copies decisions that only make sense for
//! someone who knows. Only what the policy itself earns can correct that: proximal policy optimisation (Schulman et al.
//! 2017).
//!
//! What a mission brings depends more on its devices than on one decision. So the planner, who knows everything, says
//! at every slot what is still to be had, and the policy is paid by how that changes: shaping by a potential, which
//! leaves the best policy what it is (Ng, Harada and Russell 1999). A slot that loses nothing pays nothing, and a detour
//! costs what it costs at once. A critic that sees what the policy sees learns how much it goes on to lose, and advantages
//! look some slots ahead (Schulman et al. 2016).
//!
//! The planner searches by chance, and what it finds late was there to be had before. Paid as it is found, three
//! quarters of the payments' variance would be the search's. So payments look back: what was to be had at a slot is the
//! best of what was seen then and of what the flight then brought and was seen to be had later. No slot gains that way; it
//! loses, or it does not.
//!
//! What a policy is sure of it never tries otherwise, and the critic expects the loss: where it is wrong and sure, policy
//! gradients are blind. So policies kept flying over their base by accident, which ends a mission. The planner has
//! seen what that move lost: it makes the move itself less likely, the more the surer the policy was (unlikelihood,
//! Welleck et al. 2020).
//!
//! The same blindness keeps a policy from trying another tour: the next device is settled many moves ahead, and each of
//! these moves is as sure as the others. So where the policy would do what it cannot have tried otherwise and the planner
//! sees a loss, the planner sometimes flies for some slots: a prompt. What it flew is learned if it went better than the
//! critic expected of the policy, and only until the policy is likely to try it itself.
//!
//! Each mission is seen in one of the eight views, turned or mirrored, so that nothing is learned of north alone.

use crate::env::flight::Flight;
use crate::env::variety::{Setting, Variety};
use crate::judge::evaluation::Network;
use crate::keep::checkpoint::{self, CheckpointError};
use crate::learn::learning::{Learning, Pace};
use crate::learn::mosac::Distribution;
use crate::learn::run::{LAST, Learned, Tables, TrainError, Validation};
use crate::learn::settings::Settings;
use crate::net::{self, Adam, Batch, Sample, Shape, Workspace};
use crate::planner::{Prospect, THRIFT};
use crate::systems::System;
use gleaner_policy::{Preference, View};
use gleaner_units::{Action, ActionMask};
use gleaner_world::{Realization, ScenarioKind, Stream, World};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// The checkpoint's name inside the output folder.
pub const CHECKPOINT: &str = "refine.checkpoint";
/// Missions in the air at once, and slots that each flies between two updates.
const FLIGHTS: u64 = 128;
const SLOTS: usize = 32;
/// So many of them are always out and back for energy alone. That mission lasts two slots, so among drawn ones it
/// would hardly be seen, and it must be flown exactly.
const SHORTEST: u64 = 3;
/// Passes over what was flown, and samples of one gradient step.
const PASSES: usize = 2;
const MINIBATCH: usize = 512;
/// How far the probability of an action may move from what was flown.
const CLIP: f32 = 0.15;
/// Share of the next slot's advantage: bias against noise.
const TRACE: f32 = 0.9;
/// Weight of the entropy, in standard deviations of the advantage.
const ENTROPY: f32 = 0.003;
/// The critic's unit, utility.
const VALUE_SCALE: f32 = 10.0;
/// The critic's step size in those of the actor.
const CRITIC_RATE: f32 = 3.0;
/// Updates in which only the critic learns.
const CRITIC_FIRST: u64 = 25;
/// Preferences are told apart in so many steps where advantages are made comparable, and a spread that is smaller
/// than this (percent, battery units) is not blown up.
const PREFERENCE_BINS: usize = 11;
const SPREAD_MIN: f32 = 0.3;
/// Advantages beyond this many deviations count as this much: one lost mission must not turn the policy over.
const ADVANTAGE_MAX: f32 = 8.0;
/// A move that ends the mission is a mistake if it loses more than the planner and the channel are uncertain by, utility.
const NOISE: f32 = 0.5;
/// Weight of the unlikelihood, in standard deviations of the advantage.
const UNLIKELIHOOD: f32 = 1.0;
/// Share of the slots with a move that the planner would not make in which the planner is heard, and the chance that it
/// is heard in the next slot too: one move alone is soon undone.
const PROMPTS: f64 = 0.5;
const GOING_ON: f64 = 0.8;
/// A prompt shows what the policy would hardly try itself, where what it would do loses so much utility.
const UNLIKELY: f32 = 0.2;
const WORTH_A_PROMPT: f32 = 1.5;
/// Random words that a slot's prompt may use.
const CHANCES: u128 = 1 << 20;
/// What is learned of a prompt must have gone better than this, in standard deviations of the advantage: luck alone does.
const LUCK: f32 = 0.7;
/// The longest gradient that is followed.
const GRADIENT_MAX: f32 = 0.5;
/// Share of the actor that its running average takes over per update.
const AVERAGING: f32 = 0.03;

/// One slot as it was flown.
struct Experience {
    sample: Sample,
    mask: ActionMask,
    action: Action,
    log_probability: f32,
    /// Whether the planner chose it.
    prompted: bool,
    /// What the slot brought, utility.
    brought: f32,
    /// What the planner saw to be had before and after it, utility.
    ahead: [f32; 2],
    /// What the critic expected of the gains from here on.
    value: f32,
    over: bool,
}

/// A flight in the air as the checkpoint keeps it: flown again, it is where it was.
#[derive(Default, Serialize, Deserialize)]
struct Begun {
    mission: u64,
    actions: Vec<u8>,
    prompted: bool,
}

/// What an update saw: means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Half the squared error of the critic, scaled.
    pub critic: f32,
    /// Entropy of the policy, nats.
    pub entropy: f32,
    /// How far the policy has moved from what was flown, nats.
    pub divergence: f32,
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Findings { critic, entropy, divergence } = self;
        write!(f, "critic {critic:.4}  entropy {entropy:.3}  divergence {divergence:.4}")
    }
}

/// A flight in the air, and how it came there.
struct Going {
    mission: u64,
    /// How the policy sees it.
    view: View,
    actions: Vec<u8>,
    flight: Flight,
    prospect: Prospect,
    ahead: f32,
    /// Whether the slot before was flown as the planner would.
    prompted: bool,
    /// Chance of this mission's prompts: a stretch of [`CHANCES`] words for each slot.
    chance: ChaCha8Rng,
}

/// A run of refinement.
pub struct Refinement {
    method: String,
    missions: Missions,
    world: Arc<World>,
    validation: Validation,
    flights: Vec<Going>,
    kept: Kept,
    rng: ChaCha8Rng,
    /// What passes through actor and critic.
    desks: [Desk; 2],
}

/// Memory for one network's passes.
#[derive(Default)]
struct Desk {
    batch: Batch,
    workspace: Workspace,
}

/// Where missions come from.
struct Missions {
    settings: Settings,
    variety: Variety,
}

/// What the checkpoint keeps.
#[derive(Serialize, Deserialize)]
struct Kept {
    settings: Settings,
    actor: Vec<f32>,
    averaged: Vec<f32>,
    critic: Vec<f32>,
    adams: [Adam; 2],
    flights: Vec<Begun>,
    update: u64,
    steps: u64,
    rng_word: u128,
}

const fn critic_shape() -> Shape {
    Shape { outputs: 1, ..Shape::critic() }
}

impl Missions {
    /// The flights in the air share the missions out: each goes on with the one that is [`FLIGHTS`] later.
    fn begin(&self, mission: u64) -> Result<Going, TrainError> {
        let Setting { world, rates, reports_missing } = self.variety.setting(mission);
        let mut drawn = self.settings.mission(world, mission)?;
        let (round, index) = (mission / FLIGHTS, mission % FLIGHTS);
        if index < SHORTEST && self.settings.share_rb > 0.0 {
            let scenario = ScenarioKind::ReturnBase.scenario().in_city(world.city());
            drawn.realization = Realization::draw(world.city(), &scenario, drawn.seed)?;
            drawn.preference = Preference::ENERGY;
        }
        let flight = Flight::new(world, &drawn.realization, drawn.seed, drawn.preference)?
            .with_reports_missing(reports_missing, drawn.seed);
        let mut prospect = Prospect::new(rates.study(&drawn.realization), mission);
        let ahead = prospect.value(&flight);
        let view = View::ALL[(round + index) as usize % View::ALL.len()];
        let chance = drawn.seed.repeat(u32::MAX - 1).rng(Stream::Choices);
        Ok(Going { mission, view, actions: Vec::new(), flight, prospect, ahead, prompted: false, chance })
    }
}

impl Refinement {
    /// Goes on from the checkpoint in `folder`, or begins with the actor of `first`, its logits multiplied by
    /// `confidence`: a pupil that holds many actions for good flies better by the one it holds for best.
    ///
    /// With `others` it begins with the mean of all their weights. Runs that began alike wander around the same place,
    /// and the middle of them is better than each (model soups, Wortsman et al. 2022).
    ///
    /// # Errors
    /// The checkpoint is damaged or of another run; no mission could be drawn.
    pub fn open(
        settings: Settings,
        folder: &Path,
        first: &Learned,
        others: &[Learned],
        confidence: f32,
    ) -> Result<Refinement, TrainError> {
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
            let critic = critic_shape().initialise(&mut rng);
            let mut actor = first.actor.clone();
            for (count, other) in (2_u16..).zip(others) {
                net::polyak(&mut actor, &other.actor, 1.0 / f32::from(count));
            }
            confident(&mut actor, confidence);
            Kept {
                averaged: actor.clone(),
                adams: [Adam::new(actor.len(), 0.0), Adam::new(critic.len(), 0.0)],
                actor,
                critic,
                flights: Vec::new(),
                update: 0,
                steps: first.steps + others.iter().map(|other| other.steps).sum::<u64>(),
                rng_word: 0,
                settings: settings.clone(),
            }
        };
        let world = Arc::new(World::default_world());
        let before = first.settings.command_line(&first.method, "FIRST");
        let mut run = Refinement {
            method: format!(
                "{} && gleaner-train refine --from FIRST{} --confidence {confidence}",
                before.trim_start_matches("gleaner-train "),
                " --from OTHER".repeat(others.len())
            ),
            validation: Validation::draw(&world, &settings)?,
            missions: Missions { variety: Variety::new(&world, &settings), settings },
            world,
            flights: Vec::new(),
            kept,
            rng,
            desks: Default::default(),
        };
        let mut begun = std::mem::take(&mut run.kept.flights);
        begun.extend((begun.len() as u64..FLIGHTS).map(|mission| Begun { mission, ..Begun::default() }));
        run.flights = begun
            .into_par_iter()
            .map(|begun| {
                let mut going = run.missions.begin(begun.mission)?;
                for action in begun.actions {
                    going.step(Action::from_index(usize::from(action)).unwrap_or(Action::Hover));
                }
                going.prompted = begun.prompted;
                Ok(going)
            })
            .collect::<Result<_, TrainError>>()?;
        Ok(run)
    }

    fn see(&self) -> Vec<Sample> {
        self.flights.par_iter().map(Going::sees).collect()
    }

    /// One slot of every flight.
    fn fly(&mut self, flown: &mut [Vec<Experience>]) -> Result<(), TrainError> {
        let samples = self.see();
        let Kept { actor, critic, .. } = &self.kept;
        let (logits, values) = rayon::join(
            || Network::new(Shape::actor(), actor).logits(samples.iter().copied()),
            || values(critic, &mut self.desks[1], &samples),
        );
        let units: Vec<f32> = samples.iter().map(|_| self.rng.random()).collect();
        self.kept.steps += samples.len() as u64;
        let missions = &self.missions;
        let slots = samples.into_par_iter().zip(logits).zip(values).zip(units);
        self.flights.par_iter_mut().zip(flown).zip(slots).try_for_each(
            |((going, flown), (((sample, logits), value), unit))| {
                let mask = going.mask();
                let policy = Distribution::new(&logits, mask);
                let (action, prompted) = going.prompt(policy.pick(unit), &policy);
                let before = going.ahead;
                let brought = going.step(going.meant(action));
                let ahead = [before, going.ahead];
                let over = going.flight.is_over();
                let log_probability = policy.log_probability[action.index()];
                flown.push(Experience {
                    sample,
                    mask,
                    action,
                    log_probability,
                    prompted,
                    brought,
                    ahead,
                    value,
                    over,
                });
                if over {
                    *going = missions.begin(going.mission + FLIGHTS)?;
                }
                Ok(())
            },
        )
    }

    fn learn(&mut self, lessons: &[Lesson]) -> Findings {
        let rate = self.missions.settings.learning_rate_at(self.kept.update);
        let mut order: Vec<&Lesson> = lessons.iter().collect();
        let mut passes = Vec::with_capacity(PASSES * order.len());
        for _ in 0..PASSES {
            for last in (1..order.len()).rev() {
                order.swap(last, self.rng.random_range(0..=last));
            }
            passes.extend_from_slice(&order);
        }
        let count = passes.chunks(MINIBATCH).len() as f32;
        let learns_to_act = self.kept.update >= CRITIC_FIRST;
        let Kept { actor, critic, adams: [actor_adam, critic_adam], .. } = &mut self.kept;
        let [actor_desk, critic_desk] = &mut self.desks;
        let (acting, judging) = rayon::join(
            || {
                let chunks = passes.chunks(MINIBATCH).filter(|_| learns_to_act);
                chunks.fold([0.0; 2], |[entropy, divergence], lessons| {
                    let (h, kl) = teach_actor(actor, actor_adam, actor_desk, lessons, rate);
                    [entropy + h, divergence + kl]
                })
            },
            || {
                let rate = rate * CRITIC_RATE;
                let chunks = passes.chunks(MINIBATCH);
                chunks
                    .map(|lessons| teach_critic(critic, critic_adam, critic_desk, lessons, rate))
                    .sum::<f32>()
            },
        );
        let [entropy, divergence] = acting.map(|sum| sum / count);
        Findings { critic: judging / count, entropy, divergence }
    }

    /// The averaged actor as it stands.
    #[must_use]
    pub fn last(&self) -> Learned {
        Learned {
            system: System::Gleaner,
            method: self.method.clone(),
            settings: self.missions.settings.clone(),
            actor: self.kept.averaged.clone(),
            update: self.kept.update,
            steps: self.kept.steps,
            score: f64::NEG_INFINITY,
        }
    }
}

impl Learning for Refinement {
    type Losses = Findings;
    const PACE: Pace = Pace::SLOW;

    fn settings(&self) -> &Settings {
        &self.missions.settings
    }

    fn update(&self) -> u64 {
        self.kept.update
    }

    fn steps(&self) -> u64 {
        self.kept.steps
    }

    /// Flies every mission for some slots, and learns from it.
    fn advance(&mut self) -> Result<Findings, TrainError> {
        let mut flown: Vec<Vec<Experience>> =
            self.flights.iter().map(|_| Vec::with_capacity(SLOTS)).collect();
        for _ in 0..SLOTS {
            self.fly(&mut flown)?;
        }
        let samples = self.see();
        let ahead = values(&self.kept.critic, &mut self.desks[1], &samples);
        let mut lessons = Vec::with_capacity(flown.len() * SLOTS);
        for (experiences, ahead) in flown.into_iter().zip(ahead) {
            lessons.extend(judge(experiences, ahead));
        }
        even_out(&mut lessons);
        let findings = self.learn(&lessons);
        self.kept.update += 1;
        let share = AVERAGING.max(1.0 / self.kept.update as f32);
        net::polyak(&mut self.kept.averaged, &self.kept.actor, share);
        Ok(findings)
    }

    fn validate(&mut self, best: &mut Option<Learned>) -> Result<Tables, TrainError> {
        Ok(self.validation.examine(&self.world, self.last(), best)?)
    }

    /// Writes the policy as it stands to [`LAST`], too.
    fn save(&mut self, folder: &Path) -> Result<(), CheckpointError> {
        self.kept.rng_word = self.rng.get_word_pos();
        let begun = |going: &Going| Begun {
            mission: going.mission,
            actions: going.actions.clone(),
            prompted: going.prompted,
        };
        self.kept.flights = self.flights.iter().map(begun).collect();
        checkpoint::save(&folder.join(CHECKPOINT), &self.kept)?;
        self.last().save_in(&folder.join(LAST))
    }
}

/// What the critic expects of the gains from these states on, utility.
fn values(critic: &[f32], desk: &mut Desk, samples: &[Sample]) -> Vec<f32> {
    desk.lay(samples.iter());
    let outputs = net::answer(&critic_shape(), critic, &desk.batch, &mut desk.workspace);
    outputs.iter().map(|value| value * VALUE_SCALE).collect()
}

impl Desk {
    fn lay<'a>(&mut self, samples: impl Iterator<Item = &'a Sample>) {
        self.batch.clear();
        samples.for_each(|sample| self.batch.push_sample(sample));
    }
}

/// A gradient step; gives half the mean squared error, scaled.
fn teach_critic(critic: &mut [f32], adam: &mut Adam, desk: &mut Desk, lessons: &[&Lesson], rate: f32) -> f32 {
    let scale = 1.0 / lessons.len() as f32;
    let mut gradients = vec![0.0; critic.len()];
    let mut loss = 0.0;
    desk.lay(lessons.iter().map(|lesson| &lesson.sample));
    net::forward_backward(
        &critic_shape(),
        critic,
        &desk.batch,
        &mut desk.workspace,
        |range, outputs, gradients| {
            for ((value, gradient), lesson) in outputs.iter().zip(gradients).zip(&lessons[range]) {
                let error = value - lesson.gained / VALUE_SCALE;
                loss += 0.5 * scale * error * error;
                *gradient = scale * error;
            }
        },
        &mut gradients,
    );
    shorten(&mut gradients);
    adam.lr = rate;
    adam.step(critic, &gradients);
    loss
}

/// A gradient step; gives mean entropy and divergence.
fn teach_actor(
    actor: &mut [f32],
    adam: &mut Adam,
    desk: &mut Desk,
    lessons: &[&Lesson],
    rate: f32,
) -> (f32, f32) {
    let scale = 1.0 / lessons.len() as f32;
    let mut gradients = vec![0.0; actor.len()];
    let (mut entropy, mut divergence) = (0.0, 0.0);
    desk.lay(lessons.iter().map(|lesson| &lesson.sample));
    net::forward_backward(
        &Shape::actor(),
        actor,
        &desk.batch,
        &mut desk.workspace,
        |range, outputs, gradients| {
            let rows = outputs.as_chunks::<5>().0.iter().zip(gradients.as_chunks_mut::<5>().0);
            for ((logits, gradients), lesson) in rows.zip(&lessons[range]) {
                let (h, kl) = lesson.gradient(logits, gradients);
                gradients.iter_mut().for_each(|gradient| *gradient *= scale);
                entropy += scale * h;
                divergence += scale * kl;
            }
        },
        &mut gradients,
    );
    shorten(&mut gradients);
    adam.lr = rate;
    adam.step(actor, &gradients);
    (entropy, divergence)
}

impl Going {
    fn sees(&self) -> Sample {
        self.flight.sample().seen(self.view)
    }

    /// What the guard allows, as it looks in the view.
    fn mask(&self) -> ActionMask {
        self.flight.mask().iter().fold(ActionMask::EMPTY, |mask, action| mask.with(self.view.action(action)))
    }

    /// The action that is called this in the view.
    fn meant(&self, seen: Action) -> Action {
        Action::ALL.into_iter().find(|&action| self.view.action(action) == seen).unwrap_or(seen)
    }

    /// What is flown where the policy has picked `picked`, and whether that is a prompt.
    fn prompt(&mut self, picked: Action, policy: &Distribution) -> (Action, bool) {
        self.chance.set_word_pos(self.actions.len() as u128 * CHANCES);
        let goes_on = self.prompted && self.chance.random_bool(GOING_ON);
        let begins = !self.prompted && self.chance.random_bool(PROMPTS);
        if !goes_on && !begins {
            self.prompted = false;
            return (picked, false);
        }
        let advice = self.prospect.advice(&self.flight).map(|action| self.view.action(action));
        let advice = advice.filter(|&advice| advice != picked && self.mask().allows(advice));
        let Some(advice) = advice else {
            // Both are of one mind.
            self.prompted = goes_on;
            return (picked, false);
        };
        self.prompted = goes_on || (begins && self.is_worth_a_prompt(picked, advice, policy));
        (if self.prompted { advice } else { picked }, self.prompted)
    }

    fn is_worth_a_prompt(&mut self, picked: Action, advice: Action, policy: &Distribution) -> bool {
        let picked = self.meant(picked);
        policy.probability[advice.index()] < UNLIKELY
            && self.ahead - self.prospect.value_with(&self.flight, picked, &mut self.chance) > WORTH_A_PROMPT
    }

    /// Flies a slot; gives what it brought, utility.
    fn step(&mut self, action: Action) -> f32 {
        self.actions.push(action.index() as u8);
        let [data, energy] = self.flight.step(action);
        let w_data = self.flight.preference().w_data().min(THRIFT);
        self.ahead = self.prospect.value(&self.flight);
        w_data * data + (1.0 - w_data) * energy
    }
}

/// One slot, judged.
struct Lesson {
    sample: Sample,
    mask: ActionMask,
    action: Action,
    log_probability: f32,
    prompted: bool,
    /// How much better it went than expected, under the preference.
    advantage: f32,
    /// What was gained from here on: the critic's target.
    gained: f32,
    /// What the move lost by ending the mission too early, in the unit of the advantage.
    lost: f32,
}

/// Generalised advantages of one flight's slots; `ahead` is what the critic expects after the last.
fn judge(experiences: Vec<Experience>, ahead: f32) -> Vec<Lesson> {
    let mut lessons = Vec::with_capacity(experiences.len());
    let (mut next_value, mut next_advantage) = (ahead, 0.0);
    let mut had_next = f32::NEG_INFINITY;
    for experience in experiences.into_iter().rev() {
        if experience.over {
            (next_value, next_advantage) = (0.0, 0.0);
            had_next = 0.0;
        }
        // What was to be had from here on, and how much of it is left after this slot.
        let left = experience.brought + had_next.max(experience.ahead[1]);
        let had = left.max(experience.ahead[0]);
        let gain = left - had;
        had_next = had;
        let advantage = gain + next_value - experience.value + TRACE * next_advantage;
        lessons.push(Lesson {
            sample: experience.sample,
            mask: experience.mask,
            action: experience.action,
            log_probability: experience.log_probability,
            prompted: experience.prompted,
            advantage,
            gained: advantage + experience.value,
            lost: if experience.over { (-gain - NOISE).max(0.0) } else { 0.0 },
        });
        // What came of a prompt is no merit of what the policy did before.
        let is_merit = !experience.prompted;
        (next_value, next_advantage) = (experience.value, if is_merit { advantage } else { 0.0 });
    }
    lessons
}

/// Divides the advantages by their spread among lessons of about the same preference: the noise of the data would
/// drown what half a battery unit means to those who fly for energy.
fn even_out(lessons: &mut [Lesson]) {
    let mut sums = [(0.0, 0.0); PREFERENCE_BINS];
    let bin = |lesson: &Lesson| (lesson.sample.preference[0] * (PREFERENCE_BINS - 1) as f32).round() as usize;
    for lesson in lessons.iter() {
        let (squares, count) = &mut sums[bin(lesson)];
        *squares += lesson.advantage * lesson.advantage;
        *count += 1.0_f32;
    }
    for lesson in lessons {
        let (squares, count) = sums[bin(lesson)];
        let spread = (squares / count).sqrt().max(SPREAD_MIN);
        lesson.advantage = (lesson.advantage / spread).clamp(-ADVANTAGE_MAX, ADVANTAGE_MAX);
        lesson.lost = (lesson.lost / spread).min(ADVANTAGE_MAX);
    }
}

impl Lesson {
    /// The gradient of the clipped objective and the entropy for the logits; gives entropy and divergence.
    fn gradient(&self, logits: &[f32; Action::COUNT], gradient: &mut [f32; Action::COUNT]) -> (f32, f32) {
        let policy = Distribution::new(logits, self.mask);
        let taken = self.action.index();
        let change = policy.log_probability[taken] - self.log_probability;
        let ratio = change.exp();
        let push = if self.prompted {
            // Until it is likely enough that the policy tries it itself.
            if policy.probability[taken] < UNLIKELY { (self.advantage - LUCK).max(0.0) } else { 0.0 }
        } else {
            let is_clipped = if self.advantage > 0.0 { ratio > 1.0 + CLIP } else { ratio < 1.0 - CLIP };
            if is_clipped { 0.0 } else { self.advantage * ratio }
        };
        let entropy = -policy.expectation(|action| policy.log_probability[action]);
        for (action, gradient) in gradient.iter_mut().enumerate() {
            let p = policy.probability[action];
            let chosen = if action == taken { 1.0 } else { 0.0 };
            *gradient = -push * (chosen - p) + ENTROPY * p * (policy.log_probability[action] + entropy);
        }
        self.unlearn(&policy, gradient);
        (entropy, if self.prompted { 0.0 } else { ratio - 1.0 - change })
    }

    /// Adds the gradient of `-lost log(1 - p)`, p the probability of the action: unlike a policy's, it does not vanish
    /// where the policy is sure. What the action gives up goes to the others as they stand.
    fn unlearn(&self, policy: &Distribution, gradient: &mut [f32; Action::COUNT]) {
        let taken = self.action.index();
        let others: f32 =
            (0..Action::COUNT).filter(|&other| other != taken).map(|a| policy.probability[a]).sum();
        if self.lost <= 0.0 || others <= 0.0 {
            return;
        }
        let push = UNLIKELIHOOD * self.lost * policy.probability[taken];
        for (action, gradient) in gradient.iter_mut().enumerate() {
            *gradient += if action == taken { push } else { -push * policy.probability[action] / others };
        }
    }
}

/// Scales the gradient down to [`GRADIENT_MAX`] if it is longer.
fn shorten(gradient: &mut [f32]) {
    let length = gradient.iter().map(|x| x * x).sum::<f32>().sqrt();
    if length > GRADIENT_MAX {
        gradient.iter_mut().for_each(|x| *x *= GRADIENT_MAX / length);
    }
}

/// Makes the same decisions with more confidence.
fn confident(actor: &mut [f32], confidence: f32) {
    for tensor in Shape::actor().tensors().iter().filter(|tensor| tensor.name.starts_with("head.1.")) {
        actor[tensor.offset..tensor.offset + tensor.len()].iter_mut().for_each(|x| *x *= confidence);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mistake(action: Action, lost: f32) -> Lesson {
        Lesson {
            sample: Sample::default(),
            mask: ActionMask::FULL,
            action,
            log_probability: 0.0,
            prompted: false,
            advantage: 0.0,
            gained: 0.0,
            lost,
        }
    }

    #[test]
    fn unlearning_follows_the_slope_of_its_loss_and_does_not_vanish_where_the_policy_is_sure() {
        let lesson = mistake(Action::East, 3.0);
        let mask = ActionMask::FULL;
        let loss = |logits: &[f32; Action::COUNT]| {
            let p = Distribution::new(logits, mask).probability[Action::East.index()];
            -f64::from(UNLIKELIHOOD * 3.0) * (1.0 - f64::from(p)).ln()
        };
        let logits = [0.3, -0.5, 1.0, 0.1, 0.9];
        let mut gradient = [0.0; Action::COUNT];
        lesson.unlearn(&Distribution::new(&logits, mask), &mut gradient);
        for index in 0..Action::COUNT {
            let shifted = |by: f32| {
                let mut logits = logits;
                logits[index] += by;
                loss(&logits)
            };
            let measured = (shifted(1e-2) - shifted(-1e-2)) / 2e-2;
            assert!(
                (measured - f64::from(gradient[index])).abs() < 1e-3,
                "{index}: {measured}, {gradient:?}"
            );
        }
        let mut sure = [0.0; Action::COUNT];
        sure[Action::East.index()] = 12.0;
        let mut gradient = [0.0; Action::COUNT];
        lesson.unlearn(&Distribution::new(&sure, mask), &mut gradient);
        assert!(gradient[Action::East.index()] > 2.99 * UNLIKELIHOOD, "{gradient:?}");
        assert!(gradient.iter().sum::<f32>().abs() < 1e-4);
    }

    fn slot(brought: f32, before: f32, after: f32) -> Experience {
        Experience {
            sample: Sample::default(),
            mask: ActionMask::FULL,
            action: Action::Hover,
            log_probability: 0.0,
            prompted: false,
            brought,
            ahead: [before, after],
            value: 0.0,
            over: false,
        }
    }

    /// What the slots gain: with a critic that knows nothing, the trace taken out of the advantages again.
    fn gains(experiences: Vec<Experience>) -> Vec<f32> {
        let mut next = 0.0;
        let gain =
            |lesson: &Lesson| lesson.advantage - TRACE * std::mem::replace(&mut next, lesson.advantage);
        judge(experiences, 0.0).iter().map(gain).collect::<Vec<_>>().into_iter().rev().collect()
    }

    #[test]
    fn what_the_search_finds_late_was_there_to_be_had_before() {
        // It finds 4 more while the second slot is flown: the first has not lost the 1 that it seemed to.
        assert_eq!(gains(vec![slot(2.0, 10.0, 7.0), slot(3.0, 7.0, 8.0)]), [0.0, 0.0]);
        // A loss is a loss where it was made, and only there.
        assert_eq!(
            gains(vec![slot(2.0, 10.0, 8.0), slot(1.0, 8.0, 3.0), slot(1.0, 3.0, 2.0)]),
            [0.0, -4.0, 0.0]
        );
        // Part of what seemed lost was only not found.
        assert_eq!(gains(vec![slot(2.0, 10.0, 5.0), slot(2.0, 5.0, 4.0)]), [-2.0, 0.0]);
        // What the next mission finds says nothing about the one before.
        let over = Experience { over: true, ..slot(1.0, 6.0, 0.0) };
        assert_eq!(gains(vec![over, slot(2.0, 50.0, 48.0)]), [-5.0, 0.0]);
    }

    #[test]
    fn a_prompt_is_learned_if_it_went_well_and_only_until_it_is_likely() {
        let pull = |advantage, logits: [f32; Action::COUNT]| {
            let lesson = Lesson { prompted: true, advantage, ..mistake(Action::East, 0.0) };
            let mut gradient = [0.0; Action::COUNT];
            lesson.gradient(&logits, &mut gradient);
            -gradient[Action::East.index()]
        };
        let [sure_of_hover, likely] = [[8.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]];
        assert!(
            pull(2.0, sure_of_hover) > 0.99 * (2.0 - LUCK),
            "it does not vanish where the policy is sure"
        );
        assert!(pull(LUCK, sure_of_hover).abs() < 0.01, "luck teaches nothing");
        assert!(pull(-3.0, sure_of_hover).abs() < 0.01, "nor what went worse");
        assert!(pull(2.0, likely).abs() < 0.01, "from here on the policy tries it itself");
    }

    #[test]
    fn a_move_without_alternative_and_one_without_loss_teach_nothing() {
        let mut gradient = [0.0; Action::COUNT];
        let forced = Distribution::new(&[0.0; Action::COUNT], ActionMask::EMPTY.with(Action::North));
        mistake(Action::North, 5.0).unlearn(&forced, &mut gradient);
        mistake(Action::North, 0.0)
            .unlearn(&Distribution::new(&[0.0; Action::COUNT], ActionMask::FULL), &mut gradient);
        assert_eq!(gradient, [0.0; Action::COUNT]);
    }
}
