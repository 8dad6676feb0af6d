//! Multi-objective soft actor-critic for discrete actions (paper, section IV-A).
//!
//! One actor and two critics with vector values, all conditioned on the preference; two slowly following target
//! critics; a learned entropy weight nu. Actions that the guard forbids have probability zero everywhere, so the
//! learner never spends capacity on what cannot be flown.

use crate::net::{self, Adam, Batch, Shape, Workspace};
use crate::observation::Observation;
use crate::replay::Transition;
use crate::settings::Settings;
use gleaner_policy::Preference;
use gleaner_units::{Action, ActionMask};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

const ACTIONS: usize = Action::COUNT;
const OBJECTIVES: usize = 2;
const VALUES: usize = ACTIONS * OBJECTIVES;

/// One network under training.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Trained {
    parameters: Vec<f32>,
    adam: Adam,
    #[serde(skip)]
    gradients: Vec<f32>,
}

impl Trained {
    fn new(shape: &Shape, rng: &mut ChaCha8Rng) -> Trained {
        let parameters = shape.initialise(rng);
        Trained { adam: Adam::new(parameters.len(), 0.0), gradients: Vec::new(), parameters }
    }

    fn zero_gradients(&mut self) {
        self.gradients.clear();
        self.gradients.resize(self.parameters.len(), 0.0);
    }

    fn descend(&mut self, learning_rate: f32) {
        self.adam.lr = learning_rate;
        self.adam.step(&mut self.parameters, &self.gradients);
    }
}

/// The networks and what is needed to go on learning.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Learner {
    actor: Trained,
    critics: [Trained; 2],
    targets: [Vec<f32>; 2],
    log_entropy_weight: Vec<f32>,
    adam_entropy: Adam,
    #[serde(skip)]
    scratch: Scratch,
}

#[derive(Clone, Debug, Default)]
struct Scratch {
    before: Batch,
    after: Batch,
    workspace: Workspace,
}

/// What an update saw: means over the batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// Half the squared error of both critics.
    pub critic: f32,
    /// The actor's objective.
    pub actor: f32,
    /// Entropy of the policy, nats.
    pub entropy: f32,
    /// nu.
    pub entropy_weight: f32,
}

/// The step-dependent part of the settings.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// Adam's step size.
    pub learning_rate: f32,
    /// Target entropy as a share of the largest possible.
    pub entropy_target: f32,
}

impl Learner {
    /// Fresh networks.
    #[must_use]
    pub fn new(settings: &Settings, rng: &mut ChaCha8Rng) -> Learner {
        let critics = [Trained::new(&Shape::critic(), rng), Trained::new(&Shape::critic(), rng)];
        Learner {
            actor: Trained::new(&Shape::actor(), rng),
            targets: critics.each_ref().map(|critic| critic.parameters.clone()),
            critics,
            log_entropy_weight: vec![settings.entropy_weight.ln()],
            adam_entropy: Adam::new(1, 0.0),
            scratch: Scratch::default(),
        }
    }

    /// The actor's parameters: what is exported.
    #[must_use]
    pub fn actor(&self) -> &[f32] {
        &self.actor.parameters
    }

    /// One gradient step of everything. `preferences` holds [`Settings::preferences`] of them per transition.
    pub fn update(
        &mut self,
        settings: &Settings,
        rates: Rates,
        transitions: &[&Transition],
        preferences: &[Preference],
    ) -> Losses {
        let copies = settings.preferences;
        debug_assert_eq!(preferences.len(), transitions.len() * copies);
        let samples: Vec<(&Transition, Preference)> = preferences
            .iter()
            .enumerate()
            .map(|(index, &preference)| (transitions[index / copies], preference))
            .collect();
        self.scratch.before.clear();
        self.scratch.after.clear();
        for (transition, preference) in &samples {
            self.scratch.before.push_sample(&transition.before.with(*preference));
            self.scratch.after.push_sample(&transition.after.with(*preference));
        }
        let targets = self.targets(settings, &samples);
        let (critic, values) = self.update_critics(&samples, &targets, rates);
        let (actor, entropy) = self.update_actor(&samples, &values, rates);
        for (target, critic) in self.targets.iter_mut().zip(&self.critics) {
            net::polyak(target, &critic.parameters, settings.polyak);
        }
        Losses { critic, actor, entropy, entropy_weight: self.entropy_weight() }
    }

    fn entropy_weight(&self) -> f32 {
        self.log_entropy_weight[0].exp()
    }

    /// y = r + gamma E_a' [min(T1, T2) - nu log pi], per objective (paper, eq. 17 with twin critics).
    fn targets(&mut self, settings: &Settings, samples: &[(&Transition, Preference)]) -> Vec<[f32; 2]> {
        let nu = self.entropy_weight();
        let Scratch { after, workspace, .. } = &mut self.scratch;
        let logits: Vec<[f32; ACTIONS]> =
            net::forward(&Shape::actor(), &self.actor.parameters, after, workspace).as_chunks().0.to_vec();
        let first: Vec<[f32; VALUES]> =
            net::forward(&Shape::critic(), &self.targets[0], after, workspace).as_chunks().0.to_vec();
        let second =
            net::forward(&Shape::critic(), &self.targets[1], after, workspace).as_chunks::<VALUES>().0;
        samples
            .iter()
            .enumerate()
            .map(|(index, (transition, _))| {
                let [data, energy] = transition.reward;
                let potential = |seen: &Observation| -settings.shaping * seen.way_to_terminal();
                // On the terminal the way is zero, so the end of a mission needs no case of its own.
                let shaped =
                    energy + settings.discount * potential(&transition.after) - potential(&transition.before);
                let mut target = [data, shaped].map(|reward| reward * settings.reward_scale);
                if !transition.over {
                    let policy = Distribution::new(&logits[index], transition.mask_after);
                    for (objective, target) in target.iter_mut().enumerate() {
                        let value = policy.expectation(|action| {
                            let at = action * OBJECTIVES + objective;
                            first[index][at].min(second[index][at]) - nu * policy.log_probability[action]
                        });
                        *target += settings.discount * value;
                    }
                }
                target
            })
            .collect()
    }

    /// Returns the loss and, for each sample and action, the scalarised lower value before the step.
    fn update_critics(
        &mut self,
        samples: &[(&Transition, Preference)],
        targets: &[[f32; 2]],
        rates: Rates,
    ) -> (f32, Vec<[f32; ACTIONS]>) {
        let scale = 1.0 / samples.len() as f32;
        let mut loss = 0.0;
        let mut lower: Vec<[f32; VALUES]> = vec![[f32::INFINITY; VALUES]; samples.len()];
        for critic in &mut self.critics {
            critic.zero_gradients();
            let Scratch { before, workspace, .. } = &mut self.scratch;
            net::forward_backward(
                &Shape::critic(),
                &critic.parameters,
                before,
                workspace,
                |range, outputs, gradients| {
                    gradients.fill(0.0);
                    for (row, index) in range.enumerate() {
                        let at = row * VALUES + samples[index].0.action.index() * OBJECTIVES;
                        for objective in 0..OBJECTIVES {
                            let error = outputs[at + objective] - targets[index][objective];
                            loss += 0.5 * scale * error * error;
                            gradients[at + objective] = scale * error;
                        }
                    }
                },
                &mut critic.gradients,
            );
            for (lower, values) in lower.iter_mut().zip(workspace.outputs().as_chunks::<VALUES>().0) {
                for (lower, value) in lower.iter_mut().zip(values) {
                    *lower = lower.min(*value);
                }
            }
            critic.descend(rates.learning_rate);
        }
        let scalarised = lower
            .iter()
            .zip(samples)
            .map(|(values, (_, preference))| {
                std::array::from_fn(|action| {
                    preference.w_data() * values[action * OBJECTIVES]
                        + preference.w_energy() * values[action * OBJECTIVES + 1]
                })
            })
            .collect();
        (loss, scalarised)
    }

    /// J_pi = E [sum_a pi (nu log pi - w . Q)] (paper, eq. 18); then nu towards the target entropy (eq. 19).
    fn update_actor(
        &mut self,
        samples: &[(&Transition, Preference)],
        values: &[[f32; ACTIONS]],
        rates: Rates,
    ) -> (f32, f32) {
        let nu = self.entropy_weight();
        let scale = 1.0 / samples.len() as f32;
        let (mut loss, mut entropy, mut excess) = (0.0, 0.0, 0.0);
        self.actor.zero_gradients();
        let Scratch { before, workspace, .. } = &mut self.scratch;
        net::forward_backward(
            &Shape::actor(),
            &self.actor.parameters,
            before,
            workspace,
            |range, outputs, gradients| {
                for ((logits, gradients), index) in outputs
                    .as_chunks::<ACTIONS>()
                    .0
                    .iter()
                    .zip(gradients.as_chunks_mut::<ACTIONS>().0)
                    .zip(range)
                {
                    let mask = samples[index].0.mask_before;
                    let policy = Distribution::new(logits, mask);
                    let cost = |action: usize| nu * policy.log_probability[action] - values[index][action];
                    let mean = policy.expectation(cost);
                    // d/dl_a sum_b pi_b f_b = pi_a (f_a - mean); the derivative of log pi cancels.
                    for (action, gradient) in gradients.iter_mut().enumerate() {
                        let probability = policy.probability[action];
                        *gradient =
                            if probability > 0.0 { scale * probability * (cost(action) - mean) } else { 0.0 };
                    }
                    let own = -policy.expectation(|action| policy.log_probability[action]);
                    loss += scale * mean;
                    entropy += scale * own;
                    excess += scale * (own - rates.entropy_target * (mask.len() as f32).ln());
                }
            },
            &mut self.actor.gradients,
        );
        self.actor.descend(rates.learning_rate);
        self.adam_entropy.lr = rates.learning_rate;
        self.adam_entropy.step(&mut self.log_entropy_weight, &[nu * excess]);
        (loss, entropy)
    }
}

/// A policy over the allowed actions.
#[derive(Clone, Copy, Debug)]
pub struct Distribution {
    /// Zero outside the mask.
    pub probability: [f32; ACTIONS],
    /// Zero outside the mask, where it is never used.
    pub log_probability: [f32; ACTIONS],
}

impl Distribution {
    /// The softmax of the allowed logits. An empty mask counts as full: it is only met past the end of a flight.
    #[must_use]
    pub fn new(logits: &[f32; ACTIONS], mask: ActionMask) -> Distribution {
        let mask = if mask.is_empty() { ActionMask::FULL } else { mask };
        let highest = mask.iter().map(|action| logits[action.index()]).fold(f32::NEG_INFINITY, f32::max);
        let mut distribution = Distribution { probability: [0.0; ACTIONS], log_probability: [0.0; ACTIONS] };
        let sum: f32 = mask.iter().map(|action| (logits[action.index()] - highest).exp()).sum();
        for action in mask.iter().map(Action::index) {
            distribution.log_probability[action] = logits[action] - highest - sum.ln();
            distribution.probability[action] = distribution.log_probability[action].exp();
        }
        distribution
    }

    /// sum_a pi(a) f(a).
    pub fn expectation(&self, value: impl Fn(usize) -> f32) -> f32 {
        (0..ACTIONS)
            .filter(|&action| self.probability[action] > 0.0)
            .map(|action| self.probability[action] * value(action))
            .sum()
    }

    /// The allowed action at this point of the unit interval.
    #[must_use]
    pub fn pick(&self, unit: f32) -> Action {
        let mut left = unit;
        let mut last = Action::Hover;
        for action in Action::ALL {
            let probability = self.probability[action.index()];
            if probability > 0.0 {
                last = action;
                left -= probability;
                if left < 0.0 {
                    break;
                }
            }
        }
        last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forbidden_actions_have_no_probability() {
        let mask = ActionMask::EMPTY.with(Action::Hover).with(Action::East);
        let policy = Distribution::new(&[1.0, 50.0, 50.0, 50.0, 1.0], mask);
        assert_eq!(policy.probability, [0.5, 0.0, 0.0, 0.0, 0.5]);
        assert!((policy.expectation(|a| -policy.log_probability[a]) - 2.0f32.ln()).abs() < 1e-6);
        assert_eq!(policy.pick(0.2), Action::Hover);
        assert_eq!(policy.pick(0.7), Action::East);
        assert_eq!(policy.pick(1.0), Action::East);
    }

    #[test]
    fn huge_logits_stay_finite() {
        let policy = Distribution::new(&[1e30, -1e30, 0.0, 0.0, 0.0], ActionMask::FULL);
        assert_eq!(policy.probability[0], 1.0);
        assert!(policy.expectation(|a| policy.log_probability[a]).is_finite());
    }
}
