//! Multi-objective soft actor-critic for discrete actions (paper, section IV-A).
//!
//! One actor and two critics with vector values, all conditioned on the preference; two slowly following target
//! critics; a learned entropy weight nu. Actions that the guard forbids have probability zero everywhere, so the
//! learner never spends capacity on what cannot be flown.

use crate::learn::learner::{
    self, ACTIONS, OBJECTIVES, Remembered, Scratch, Trained, VALUES, scalarise, seen_reward,
};
use crate::learn::settings::Settings;
use crate::net::{self, Adam, Architecture};
use crate::observe::encoding::Encoding;
use crate::systems::System;
use gleaner_policy::Preference;
use gleaner_units::{Action, ActionMask};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The networks and what is needed to go on learning.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Learner<E: Encoding> {
    actor: Trained,
    critics: [Trained; 2],
    targets: [Vec<f32>; 2],
    log_entropy_weight: Vec<f32>,
    adam_entropy: Adam,
    #[serde(skip)]
    scratch: Scratch<E>,
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

impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Losses { critic, entropy, entropy_weight, .. } = self;
        write!(f, "critic {critic:.4}  entropy {entropy:.3}  nu {entropy_weight:.5}")
    }
}

/// The step-dependent part of the settings.
#[derive(Clone, Copy, Debug)]
struct Rates {
    /// Adam's step size.
    learning_rate: f32,
    /// Target entropy as a share of the largest possible.
    entropy_target: f32,
    /// Temperature of the policy's softmax inside targets, losses and entropy.
    heat: f32,
}

/// A transition under a preference.
type Sample<'a, E> = (&'a Remembered<E>, Preference);

impl<E: Encoding> learner::Learner for Learner<E> {
    type Encoding = E;
    type Losses = Losses;
    const SYSTEM: System = E::MOSAC;

    fn new(settings: &Settings, rng: &mut ChaCha8Rng) -> Learner<E> {
        let critics = [Trained::new(&critic::<E>(), rng), Trained::new(&critic::<E>(), rng)];
        Learner {
            actor: Trained::new(&actor::<E>(), rng),
            targets: critics.each_ref().map(|critic| critic.parameters.clone()),
            critics,
            log_entropy_weight: vec![settings.entropy_weight.ln()],
            adam_entropy: Adam::new(1, 0.0),
            scratch: Scratch::default(),
        }
    }

    fn network() -> E::Network {
        actor::<E>()
    }

    fn deciding(&self) -> &[f32] {
        &self.actor.parameters
    }

    fn update(
        &mut self,
        encoding: &E,
        settings: &Settings,
        update: u64,
        transitions: &[&Remembered<E>],
        preferences: &[Preference],
    ) -> Losses {
        let rates = Rates {
            learning_rate: settings.learning_rate_at(update),
            entropy_target: settings.entropy_target_at(update),
            heat: if settings.heat_in_policy { settings.heat_at(update) } else { 1.0 },
        };
        let copies = settings.preferences;
        debug_assert_eq!(preferences.len(), transitions.len() * copies);
        let samples: Vec<Sample<'_, E>> = preferences
            .iter()
            .enumerate()
            .map(|(index, &preference)| (transitions[index / copies], preference))
            .collect();
        self.scratch.pack(encoding, transitions, preferences);
        let targets = self.targets(settings, &samples, rates);
        let (critic, values) = self.update_critics(&samples, &targets, rates);
        let (actor, entropy) = self.update_actor(&samples, &values, rates);
        for (target, critic) in self.targets.iter_mut().zip(&self.critics) {
            net::polyak(target, &critic.parameters, settings.polyak);
        }
        Losses { critic, actor, entropy, entropy_weight: self.entropy_weight() }
    }

    fn scores(logits: &[f32], _: Preference) -> [f32; ACTIONS] {
        std::array::from_fn(|action| logits[action])
    }

    /// The heated softmax (paper, eq. 20).
    fn explore(settings: &Settings, update: u64, logits: &[f32; ACTIONS], mask: ActionMask) -> Distribution {
        Distribution::heated(logits, settings.heat_at(update), mask)
    }
}

fn actor<E: Encoding>() -> E::Network {
    E::network(ACTIONS)
}

fn critic<E: Encoding>() -> E::Network {
    E::network(VALUES)
}

impl<E: Encoding> Learner<E> {
    fn entropy_weight(&self) -> f32 {
        self.log_entropy_weight[0].exp()
    }

    /// y = r + gamma E_a' [min(T1, T2) - nu log pi], per objective (paper, eq. 17 with twin critics).
    fn targets(
        &mut self,
        settings: &Settings,
        samples: &[Sample<'_, E>],
        rates: Rates,
    ) -> Vec<[f32; OBJECTIVES]> {
        let nu = self.entropy_weight();
        let Scratch { after, workspace, .. } = &mut self.scratch;
        let logits: Vec<[f32; ACTIONS]> =
            actor::<E>().forward(&self.actor.parameters, after, workspace).as_chunks().0.to_vec();
        let first: Vec<[f32; VALUES]> =
            critic::<E>().forward(&self.targets[0], after, workspace).as_chunks().0.to_vec();
        let second = critic::<E>().forward(&self.targets[1], after, workspace).as_chunks::<VALUES>().0;
        samples
            .iter()
            .enumerate()
            .map(|(index, (transition, _))| {
                let mut target = seen_reward::<E>(settings, transition);
                if !transition.over {
                    let policy = Distribution::heated(&logits[index], rates.heat, transition.mask_after);
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
        samples: &[Sample<'_, E>],
        targets: &[[f32; OBJECTIVES]],
        rates: Rates,
    ) -> (f32, Vec<[f32; ACTIONS]>) {
        let scale = 1.0 / samples.len() as f32;
        let mut loss = 0.0;
        let mut lower: Vec<[f32; VALUES]> = vec![[f32::INFINITY; VALUES]; samples.len()];
        for trained in &mut self.critics {
            trained.zero_gradients();
            let Scratch { before, workspace, .. } = &mut self.scratch;
            let values = critic::<E>().forward_backward(
                &trained.parameters,
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
                &mut trained.gradients,
            );
            for (lower, values) in lower.iter_mut().zip(values.as_chunks::<VALUES>().0) {
                for (lower, value) in lower.iter_mut().zip(values) {
                    *lower = lower.min(*value);
                }
            }
            trained.descend(rates.learning_rate);
        }
        let scalarised =
            lower.iter().zip(samples).map(|(values, (_, preference))| scalarise(values, *preference));
        (loss, scalarised.collect())
    }

    /// J_pi = E [sum_a pi (nu log pi - w . Q)] (paper, eq. 18); then nu towards the target entropy (eq. 19).
    fn update_actor(
        &mut self,
        samples: &[Sample<'_, E>],
        values: &[[f32; ACTIONS]],
        rates: Rates,
    ) -> (f32, f32) {
        let nu = self.entropy_weight();
        let scale = 1.0 / samples.len() as f32;
        let (mut loss, mut entropy, mut excess) = (0.0, 0.0, 0.0);
        self.actor.zero_gradients();
        let Scratch { before, workspace, .. } = &mut self.scratch;
        actor::<E>().forward_backward(
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
                    let policy = Distribution::heated(logits, rates.heat, mask);
                    let cost = |action: usize| nu * policy.log_probability[action] - values[index][action];
                    let mean = policy.expectation(cost);
                    // d/dl_a sum_b pi_b f_b = pi_a (f_a - mean) / heat; the derivative of log pi cancels.
                    for (action, gradient) in gradients.iter_mut().enumerate() {
                        let probability = policy.probability[action];
                        *gradient = if probability > 0.0 {
                            scale * probability * (cost(action) - mean) / rates.heat
                        } else {
                            0.0
                        };
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

    /// The softmax of the allowed logits at this temperature (paper, eq. 20).
    #[must_use]
    pub fn heated(logits: &[f32; ACTIONS], heat: f32, mask: ActionMask) -> Distribution {
        Distribution::new(&logits.map(|logit| logit / heat), mask)
    }

    /// The best of the allowed actions, but a random one of them in a share `epsilon` of all cases.
    #[must_use]
    pub fn epsilon_greedy(epsilon: f32, scores: &[f32; ACTIONS], mask: ActionMask) -> Distribution {
        let mut distribution = Distribution::new(&[0.0; ACTIONS], mask);
        let Some(best) = mask.argmax(scores) else { return distribution };
        for (action, probability) in distribution.probability.iter_mut().enumerate() {
            *probability *= epsilon;
            *probability += if action == best.index() { 1.0 - epsilon } else { 0.0 };
        }
        distribution.log_probability = distribution.probability.map(|p| if p > 0.0 { p.ln() } else { 0.0 });
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
    fn epsilon_greedy_takes_allowed_actions_only() {
        let mask = ActionMask::EMPTY.with(Action::Hover).with(Action::East);
        let policy = Distribution::epsilon_greedy(0.5, &[1.0, 50.0, 50.0, 50.0, 2.0], mask);
        assert_eq!(policy.probability, [0.25, 0.0, 0.0, 0.0, 0.75]);
        let sure = Distribution::epsilon_greedy(0.0, &[1.0, 50.0, 50.0, 50.0, 2.0], mask);
        assert_eq!(sure.probability, [0.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(sure.log_probability, [0.0; ACTIONS]);
    }

    #[test]
    fn huge_logits_stay_finite() {
        let policy = Distribution::new(&[1e30, -1e30, 0.0, 0.0, 0.0], ActionMask::FULL);
        assert_eq!(policy.probability[0], 1.0);
        assert!(policy.expectation(|a| policy.log_probability[a]).is_finite());
    }
}
