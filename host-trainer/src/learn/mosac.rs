//! Multi-objective soft actor-critic for discrete actions (paper, section IV-A).
//!
//! One actor and twin critics with vector values, all conditioned on the preference; two target critics; a learned
//! entropy coefficient nu. Forbidden actions have probability zero in the policy, the targets and the losses.

use crate::env::distribution::{ACTIONS, Distribution};
use crate::learn::algorithm::{
    Algorithm, OBJECTIVES, Scratch, TrainedNetwork, TransitionOf, VALUES, bootstrap_discount,
    learning_reward, scalarise,
};
use crate::net::{self, Adam, Architecture};
use crate::observe::Encoding;
use crate::settings::{Settings, TwinMinimum};
use gleaner_policy::Preference;
use gleaner_units::ActionMask;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The networks and the state of their optimisers.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Mosac<E: Encoding> {
    actor: TrainedNetwork,
    critics: [TrainedNetwork; 2],
    targets: [Vec<f32>; 2],
    /// ln nu, as a parameter vector of length 1.
    log_entropy_coefficient: Vec<f32>,
    entropy_adam: Adam,
    #[serde(skip)]
    scratch: Scratch<E>,
}

/// Means over the batch of one update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// Half the squared error, summed over both critics.
    pub critic: f32,
    /// Loss of the actor.
    pub actor: f32,
    /// Entropy of the policy, nats.
    pub entropy: f32,
    /// Entropy coefficient nu.
    pub entropy_weight: f32,
}

impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Losses { critic, entropy, entropy_weight, .. } = self;
        write!(f, "critic {critic:.4}  entropy {entropy:.3}  nu {entropy_weight:.5}")
    }
}

/// Hyper-parameters of one update.
#[derive(Clone, Copy, Debug)]
struct UpdateSettings {
    /// Adam's step size.
    learning_rate: f32,
    /// Target entropy as a share of the entropy of the uniform policy.
    entropy_target: f32,
    /// Temperature of the softmax in targets, losses and entropy.
    heat: f32,
    /// Weight of the state value in the targets.
    discount: f32,
    /// How the twin critics are combined.
    twin_minimum: TwinMinimum,
}

/// A transition under a preference.
type Sample<'a, E> = (&'a TransitionOf<E>, Preference);

impl<E: Encoding> Algorithm for Mosac<E> {
    type Encoding = E;
    type Losses = Losses;
    const NAME: &'static str = E::MOSAC_NAME;

    fn new(settings: &Settings, rng: &mut ChaCha8Rng) -> Mosac<E> {
        let critics = [TrainedNetwork::new(&critic::<E>(), rng), TrainedNetwork::new(&critic::<E>(), rng)];
        Mosac {
            actor: TrainedNetwork::new(&actor::<E>(), rng),
            targets: critics.each_ref().map(|critic| critic.parameters.clone()),
            critics,
            log_entropy_coefficient: vec![settings.entropy_weight.ln()],
            entropy_adam: Adam::new(1, 0.0),
            scratch: Scratch::default(),
        }
    }

    fn network() -> E::Network {
        actor::<E>()
    }

    fn policy_parameters(&self) -> &[f32] {
        &self.actor.parameters
    }

    fn update(
        &mut self,
        encoding: &E,
        settings: &Settings,
        update: u64,
        transitions: &[&TransitionOf<E>],
        preferences: &[Preference],
    ) -> Losses {
        let update_settings = UpdateSettings {
            learning_rate: settings.learning_rate_at(update),
            entropy_target: settings.entropy_target_at(update),
            heat: if settings.heat_in_policy { settings.heat_at(update) } else { 1.0 },
            discount: bootstrap_discount(settings),
            twin_minimum: settings.twin_minimum,
        };
        let copies = settings.preferences;
        debug_assert_eq!(preferences.len(), transitions.len() * copies);
        let samples: Vec<Sample<'_, E>> = preferences
            .iter()
            .enumerate()
            .map(|(index, &preference)| (transitions[index / copies], preference))
            .collect();
        self.scratch.pack(encoding, transitions, preferences);
        let rewards: Vec<_> =
            samples.iter().map(|(transition, _)| learning_reward::<E>(settings, transition)).collect();
        let targets = self.targets(rewards, &samples, update_settings);
        let (critic, values) = self.update_critics(&samples, &targets, update_settings);
        let (actor, entropy) = self.update_actor(&samples, &values, update_settings);
        for (target, critic) in self.targets.iter_mut().zip(&self.critics) {
            net::polyak(target, &critic.parameters, settings.polyak);
        }
        Losses { critic, actor, entropy, entropy_weight: self.entropy_coefficient() }
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

impl<E: Encoding> Mosac<E> {
    fn entropy_coefficient(&self) -> f32 {
        self.log_entropy_coefficient[0].exp()
    }

    /// y = r + gamma^n E_a' [min(T1, T2) - nu ln pi], per objective (paper, eq. 17 with twin critics). `rewards`
    /// becomes the targets.
    fn targets(
        &mut self,
        mut rewards: Vec<[f32; OBJECTIVES]>,
        samples: &[Sample<'_, E>],
        settings: UpdateSettings,
    ) -> Vec<[f32; OBJECTIVES]> {
        let nu = self.entropy_coefficient();
        let Scratch { after, workspace, .. } = &mut self.scratch;
        let logits: Vec<[f32; ACTIONS]> =
            actor::<E>().forward(&self.actor.parameters, after, workspace).as_chunks().0.to_vec();
        let first: Vec<[f32; VALUES]> =
            critic::<E>().forward(&self.targets[0], after, workspace).as_chunks().0.to_vec();
        let second = critic::<E>().forward(&self.targets[1], after, workspace).as_chunks::<VALUES>().0;
        for (index, (target, (transition, preference))) in rewards.iter_mut().zip(samples).enumerate() {
            if transition.over {
                continue;
            }
            let policy = Distribution::heated(&logits[index], settings.heat, transition.mask_after);
            let values = twin_minimum(settings.twin_minimum, &first[index], &second[index], *preference);
            for (objective, target) in target.iter_mut().enumerate() {
                let state_value = policy.expectation(|action| {
                    values[action * OBJECTIVES + objective] - nu * policy.log_probability[action]
                });
                *target += settings.discount * state_value;
            }
        }
        rewards
    }

    /// A step of both critics. Returns the loss and, for each sample and action, the scalarised twin minimum before the
    /// step.
    fn update_critics(
        &mut self,
        samples: &[Sample<'_, E>],
        targets: &[[f32; OBJECTIVES]],
        settings: UpdateSettings,
    ) -> (f32, Vec<[f32; ACTIONS]>) {
        let scale = 1.0 / samples.len() as f32;
        let mut loss = 0.0;
        let [first, second] = self.critics.each_mut().map(|trained| {
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
            let values = values.as_chunks::<VALUES>().0.to_vec();
            trained.descend(settings.learning_rate);
            values
        });
        let values = first.iter().zip(&second).zip(samples);
        let lower = values.map(|((first, second), (_, preference))| {
            scalarise(&twin_minimum(settings.twin_minimum, first, second, *preference), *preference)
        });
        (loss, lower.collect())
    }

    /// A step of the actor (paper, eq. 18), then a step of nu towards the target entropy (eq. 19). Returns the actor's
    /// loss and the entropy.
    fn update_actor(
        &mut self,
        samples: &[Sample<'_, E>],
        values: &[[f32; ACTIONS]],
        settings: UpdateSettings,
    ) -> (f32, f32) {
        let nu = self.entropy_coefficient();
        let scale = 1.0 / samples.len() as f32;
        let (mut loss, mut entropy, mut excess) = (0.0, 0.0, 0.0);
        self.actor.zero_gradients();
        let Scratch { before, workspace, .. } = &mut self.scratch;
        actor::<E>().forward_backward(
            &self.actor.parameters,
            before,
            workspace,
            |range, outputs, gradients| {
                let rows = outputs.as_chunks::<ACTIONS>().0.iter();
                for ((logits, gradients), index) in
                    rows.zip(gradients.as_chunks_mut::<ACTIONS>().0).zip(range)
                {
                    let mask = samples[index].0.mask_before;
                    let policy = Distribution::heated(logits, settings.heat, mask);
                    loss += scale * actor_loss(&policy, settings.heat, nu, &values[index], gradients);
                    gradients.iter_mut().for_each(|gradient| *gradient *= scale);
                    let own = policy.entropy();
                    entropy += scale * own;
                    excess += scale * (own - settings.entropy_target * (mask.len() as f32).ln());
                }
            },
            &mut self.actor.gradients,
        );
        self.actor.descend(settings.learning_rate);
        self.entropy_adam.lr = settings.learning_rate;
        self.entropy_adam.step(&mut self.log_entropy_coefficient, &[nu * excess]);
        (loss, entropy)
    }
}

/// J = sum_a pi(a) (nu ln pi(a) - w . Q(a)) with pi the softmax of `logits / heat`. Writes dJ / d logits.
fn actor_loss(
    policy: &Distribution,
    heat: f32,
    nu: f32,
    values: &[f32; ACTIONS],
    gradients: &mut [f32; ACTIONS],
) -> f32 {
    let cost = |action: usize| nu * policy.log_probability[action] - values[action];
    let mean = policy.expectation(cost);
    // d/dl_a sum_b pi_b f_b = pi_a (f_a - mean) / heat; the derivative of ln pi inside f sums to zero.
    for (action, gradient) in gradients.iter_mut().enumerate() {
        let probability = policy.probability[action];
        *gradient = if probability > 0.0 { probability * (cost(action) - mean) / heat } else { 0.0 };
    }
    mean
}

/// The pessimistic values of two critics.
fn twin_minimum(
    rule: TwinMinimum,
    first: &[f32; VALUES],
    second: &[f32; VALUES],
    preference: Preference,
) -> [f32; VALUES] {
    match rule {
        TwinMinimum::PerObjective => std::array::from_fn(|at| first[at].min(second[at])),
        TwinMinimum::Scalarised => {
            let [one, two] = [first, second].map(|values| scalarise(values, preference));
            std::array::from_fn(|at| {
                let action = at / OBJECTIVES;
                if two[action] < one[action] { second[at] } else { first[at] }
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::Action;

    #[test]
    fn actor_gradient_matches_finite_differences_at_any_heat() {
        let mask =
            ActionMask::from_bits(ActionMask::FULL.bits() & !ActionMask::EMPTY.with(Action::South).bits());
        let (values, nu) = ([0.3, -0.2, 0.9, 0.0, 0.5], 0.37);
        let logits = [0.4, -1.1, 2.0, 0.7, -0.3];
        for heat in [1.0, 1.5, 5.0] {
            let loss = |logits: &[f32; ACTIONS]| {
                let policy = Distribution::heated(logits, heat, mask);
                f64::from(actor_loss(&policy, heat, nu, &values, &mut [0.0; ACTIONS]))
            };
            let mut gradient = [0.0; ACTIONS];
            actor_loss(&Distribution::heated(&logits, heat, mask), heat, nu, &values, &mut gradient);
            for action in 0..ACTIONS {
                let shifted = |by: f32| {
                    let mut logits = logits;
                    logits[action] += by;
                    loss(&logits)
                };
                let measured = (shifted(1e-2) - shifted(-1e-2)) / 2e-2;
                let error = (measured - f64::from(gradient[action])).abs();
                assert!(error < 1e-4, "heat {heat}, action {action}: {measured}, {gradient:?}");
            }
            assert_eq!(gradient[Action::South.index()], 0.0, "a forbidden action has no gradient");
        }
    }

    #[test]
    fn scalarised_twin_minimum_does_not_mix_critics() {
        let (mut first, mut second) = ([0.0; VALUES], [0.0; VALUES]);
        // Action 0: the first critic is lower in data, the second in energy and in w . Q.
        (first[0], first[1]) = (1.0, -1.0);
        (second[0], second[1]) = (2.0, -4.0);
        let preference = Preference::new(0.5).unwrap();
        let mixed = twin_minimum(TwinMinimum::PerObjective, &first, &second, preference);
        assert_eq!(mixed[..2], [1.0, -4.0]);
        let whole = twin_minimum(TwinMinimum::Scalarised, &first, &second, preference);
        assert_eq!(whole[..2], [2.0, -4.0]);
        let data = twin_minimum(TwinMinimum::Scalarised, &first, &second, Preference::DATA);
        assert_eq!(data[..2], [1.0, -1.0]);
    }
}
