//! Refinement of a trained policy from its own flights: proximal policy optimisation (Schulman et al. 2017).
//!
//! A student of the planner copies decisions that need the planner's knowledge. Only the student's own returns can
//! correct them.
//!
//! - **Reward.** The return of a mission depends more on its devices than on any one decision. The planner, which has
//!   full knowledge, therefore estimates the state value in every slot, and the reward is shaped by its change
//!   (potential-based shaping: Ng, Harada and Russell 1999). See `advantage`.
//! - **Advantage.** A critic with the policy's observation learns the expected sum of the shaped rewards; advantages are
//!   generalised estimates (Schulman et al. 2016), normalised by preference.
//! - **Unlikelihood.** A policy gradient vanishes where the policy is certain. Without a remedy, policies kept the error of
//!   flying over the terminal, which ends the mission. An additional loss lowers the probability of a move that ends a
//!   mission too early. See `loss`.
//! - **Prompts.** For the same reason a certain policy does not explore another device order. The planner sometimes selects
//!   the actions of a few slots, and the policy imitates them if their advantage is large. See `prompt`.
//! - **Views.** Each mission is observed in one of the eight views, rotated or mirrored, so that no direction is special.

mod advantage;
mod loss;
mod prompt;
mod rollout;
pub mod settings;

use crate::env::distribution::Distribution;
use crate::env::site::Site;
use crate::env::variety::Variety;
use crate::judge::evaluation::Network;
use crate::judge::validation::{Tables, Validation};
use crate::keep::checkpoint::CheckpointError;
use crate::keep::snapshot::{LAST, Snapshot};
use crate::learn::resume;
use crate::learn::trainer::{Pace, TrainError, Trainer};
use crate::net::{self, Adam, Sample, Shape};
use crate::observe::Encoding;
use crate::observe::tokens::PolicyTokens;
use crate::settings::Settings;
use advantage::Target;
use loss::{Buffers, critic_shape, step_actor, step_critic, values};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use rollout::{Experience, Missions, RolloutFlight, StoredFlight};
use serde::{Deserialize, Serialize};
use settings::PpoSettings;
use std::fmt;
use std::path::Path;

/// File name of the checkpoint inside the output folder.
pub const CHECKPOINT: &str = "refine.checkpoint";
/// Name in the checkpoint.
const NAME: &str = "refine";

/// Means over one update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// Half the squared error of the critic, scaled.
    pub critic: f32,
    /// Entropy of the policy, nats.
    pub entropy: f32,
    /// Approximate KL divergence from the policy that flew, nats.
    pub divergence: f32,
}

impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Losses { critic, entropy, divergence } = self;
        write!(f, "critic {critic:.4}  entropy {entropy:.3}  divergence {divergence:.4}")
    }
}

/// A run of refinement.
pub struct Refinement {
    method: String,
    settings: Settings,
    constants: PpoSettings,
    missions: Missions,
    site: Site,
    validation: Validation,
    flights: Vec<RolloutFlight>,
    stored: Stored,
    rng: ChaCha8Rng,
    actor_buffers: Buffers,
    critic_buffers: Buffers,
}

/// The checkpoint after the settings. The field order is the file format.
#[derive(Serialize, Deserialize)]
struct Stored {
    actor: Vec<f32>,
    averaged: Vec<f32>,
    critic: Vec<f32>,
    /// Of actor and critic.
    adams: [Adam; 2],
    flights: Vec<StoredFlight>,
    update: u64,
    steps: u64,
    rng_word: u128,
}

impl Refinement {
    /// Continues from the checkpoint in `folder`, or starts with the actor of `first`. Its logits are multiplied by
    /// `confidence`: with the flat distribution of a student, samples would rarely be the best action.
    ///
    /// With `others` it starts with the mean of all parameters. The parameters of runs with the same start stay close to each
    /// other, and their mean performs better than each of them (model soups: Wortsman et al. 2022).
    ///
    /// # Errors
    /// The checkpoint is damaged or of another run; no mission could be drawn.
    pub fn open(
        settings: Settings,
        site: Site,
        folder: &Path,
        first: &Snapshot,
        others: &[Snapshot],
        confidence: f32,
    ) -> Result<Refinement, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let mut stored = match resume::load::<Stored>(&folder.join(CHECKPOINT), NAME, &settings)? {
            Some(stored) => {
                rng.set_word_pos(stored.rng_word);
                stored
            }
            None => Stored::start(first, others, confidence, &mut rng),
        };
        let constants = PpoSettings::DEFAULT;
        let variety = Variety::new(&site, settings.share_cities, settings.share_mismatched);
        let missions = Missions::new(&settings, variety, constants);
        let mut flights = std::mem::take(&mut stored.flights);
        let more = flights.len() as u64..constants.flights;
        flights.extend(more.map(|mission| StoredFlight { mission, ..StoredFlight::default() }));
        let flights = flights.into_par_iter().map(|flight| missions.restore(flight));
        Ok(Refinement {
            method: method(first, others, confidence),
            validation: Validation::draw(&site, &settings)?,
            flights: flights.collect::<Result<_, TrainError>>()?,
            missions,
            settings,
            constants,
            site,
            stored,
            rng,
            actor_buffers: Buffers::default(),
            critic_buffers: Buffers::default(),
        })
    }

    fn observe(&self) -> Vec<Sample> {
        self.flights.par_iter().map(RolloutFlight::observe).collect()
    }

    /// One slot of every flight.
    fn collect(&mut self, recorded: &mut [Vec<Experience>]) -> Result<(), TrainError> {
        let samples = self.observe();
        let Stored { actor, critic, .. } = &self.stored;
        let constants = &self.constants;
        let (logits, values) = rayon::join(
            || Network::new(Shape::actor(), actor).logits(samples.iter().copied()),
            || values(critic, &mut self.critic_buffers, &samples, constants.value_scale),
        );
        let units: Vec<f32> = samples.iter().map(|_| self.rng.random()).collect();
        self.stored.steps += samples.len() as u64;
        let missions = &self.missions;
        let slots = samples.into_par_iter().zip(logits).zip(values).zip(units);
        self.flights.par_iter_mut().zip(recorded).zip(slots).try_for_each(
            |((flight, recorded), (((sample, logits), value), unit))| {
                let mask = flight.mask();
                let policy = Distribution::new(&logits, mask);
                let (action, is_prompted) = flight.prompt(policy.sample(unit), &policy, constants);
                let value_before = flight.planner_value;
                let reward = flight.step(flight.unviewed(action));
                let is_over = flight.flight.is_over();
                recorded.push(Experience {
                    sample,
                    mask,
                    action,
                    log_probability: policy.log_probability[action.index()],
                    is_prompted,
                    reward,
                    planner_values: [value_before, flight.planner_value],
                    value,
                    is_over,
                });
                if is_over {
                    *flight = missions.next(flight)?;
                }
                Ok(())
            },
        )
    }

    /// All epochs of gradient steps over one rollout.
    fn learn(&mut self, targets: &[Target]) -> Losses {
        let constants = &self.constants;
        let rate = self.settings.learning_rate_at(self.stored.update);
        let mut order: Vec<&Target> = targets.iter().collect();
        let mut epochs = Vec::with_capacity(constants.epochs * order.len());
        for _ in 0..constants.epochs {
            for last in (1..order.len()).rev() {
                order.swap(last, self.rng.random_range(0..=last));
            }
            epochs.extend_from_slice(&order);
        }
        let minibatches = || epochs.chunks(constants.minibatch);
        let count = minibatches().len() as f32;
        let trains_actor = self.stored.update >= constants.critic_warm_up;
        let Stored { actor, critic, adams: [actor_adam, critic_adam], .. } = &mut self.stored;
        let (actor_buffers, critic_buffers) = (&mut self.actor_buffers, &mut self.critic_buffers);
        let ([entropy, divergence], critic) = rayon::join(
            || {
                minibatches().filter(|_| trains_actor).fold([0.0; 2], |[entropy, divergence], batch| {
                    let (h, kl) = step_actor(actor, actor_adam, actor_buffers, batch, rate, constants);
                    [entropy + h, divergence + kl]
                })
            },
            || {
                let rate = rate * constants.critic_rate;
                minibatches()
                    .map(|batch| step_critic(critic, critic_adam, critic_buffers, batch, rate, constants))
                    .sum::<f32>()
            },
        );
        Losses { critic: critic / count, entropy: entropy / count, divergence: divergence / count }
    }

    /// The averaged policy as it is now.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
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
    fn start(first: &Snapshot, others: &[Snapshot], confidence: f32, rng: &mut ChaCha8Rng) -> Stored {
        let critic = critic_shape().initialise(rng);
        let mut actor = first.actor.clone();
        for (count, other) in (2_u16..).zip(others) {
            net::polyak(&mut actor, &other.actor, 1.0 / f32::from(count));
        }
        scale_logits(&mut actor, confidence);
        Stored {
            averaged: actor.clone(),
            adams: [Adam::new(actor.len(), 0.0), Adam::new(critic.len(), 0.0)],
            actor,
            critic,
            flights: Vec::new(),
            update: 0,
            steps: first.steps + others.iter().map(|other| other.steps).sum::<u64>(),
            rng_word: 0,
        }
    }
}

/// The chain of commands that ends with this run, without its settings.
fn method(first: &Snapshot, others: &[Snapshot], confidence: f32) -> String {
    format!(
        "{} && gleaner-train refine --from FIRST{} --confidence {confidence}",
        first.command_line("FIRST").trim_start_matches("gleaner-train "),
        " --from OTHER".repeat(others.len())
    )
}

/// Multiplies the logits: the same best action with another probability.
fn scale_logits(actor: &mut [f32], factor: f32) {
    for tensor in Shape::actor().tensors().iter().filter(|tensor| tensor.name.starts_with("head.1.")) {
        actor[tensor.offset..tensor.offset + tensor.len()].iter_mut().for_each(|x| *x *= factor);
    }
}

impl Trainer for Refinement {
    type Losses = Losses;
    const PACE: Pace = Pace::SLOW;

    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn update(&self) -> u64 {
        self.stored.update
    }

    fn steps(&self) -> u64 {
        self.stored.steps
    }

    /// Collects one rollout and trains on it.
    fn advance(&mut self) -> Result<Losses, TrainError> {
        let slots = self.constants.slots;
        let mut recorded: Vec<Vec<Experience>> =
            self.flights.iter().map(|_| Vec::with_capacity(slots)).collect();
        for _ in 0..slots {
            self.collect(&mut recorded)?;
        }
        let samples = self.observe();
        let scale = self.constants.value_scale;
        let values_after = values(&self.stored.critic, &mut self.critic_buffers, &samples, scale);
        let mut targets = Vec::with_capacity(recorded.len() * slots);
        for (experiences, value_after) in recorded.into_iter().zip(values_after) {
            targets.extend(advantage::targets(experiences, value_after, &self.constants));
        }
        advantage::normalise(&mut targets, &self.constants);
        let losses = self.learn(&targets);
        self.stored.update += 1;
        // A plain mean at first, so that the initial parameters soon have no weight.
        let share = self.constants.averaging.max(1.0 / self.stored.update as f32);
        net::polyak(&mut self.stored.averaged, &self.stored.actor, share);
        Ok(losses)
    }

    fn validate(&mut self, best: &mut Option<Snapshot>) -> Result<Tables, TrainError> {
        let tables = self.validation.judge(self.site.world(), &self.stored.averaged)?;
        Snapshot { score: tables.score(), ..self.snapshot() }.offer(best);
        Ok(tables)
    }

    fn save(&mut self, folder: &Path) -> Result<(), CheckpointError> {
        self.stored.rng_word = self.rng.get_word_pos();
        self.stored.flights = self.flights.iter().map(RolloutFlight::stored).collect();
        resume::save(&folder.join(CHECKPOINT), NAME, &self.settings, &self.stored)?;
        self.snapshot().save(&folder.join(LAST))
    }
}
