//! Double deep Q-network (van Hasselt, Guez and Silver 2016) with vector values: the paper's DDQN-CGL.
//!
//! The paper takes the network of Theile et al. and concatenates the preference. Its value functions are vectors
//! conditioned on the preference (section IV-A, after Abels et al. 2019), and all its algorithms share learning rate,
//! batch, replay and J = 3 preferences per transition (section V-B). Accordingly, one network estimates `Q(s, a, w)`
//! for both objectives; the online network selects the next action by `w . Q` and the target network evaluates it; the
//! loss is the squared error per objective, as for the critics of MOSAC (eq. 16). Actions that the guard forbids are
//! neither taken nor selected in targets. The paper does not describe the exploration. Here it is epsilon-greedy, and
//! epsilon falls over the same environment steps as the temperature of MOSAC.

use crate::env::distribution::{ACTIONS, Distribution};
use crate::learn::algorithm::{
    Algorithm, OBJECTIVES, Scratch, TrainedNetwork, TransitionOf, VALUES, bootstrap_discount,
    learning_reward, scalarise,
};
use crate::learn::constants::CONSTANTS;
use crate::net::{self, Architecture};
use crate::observe::Encoding;
use crate::settings::{Settings, interpolate};
use gleaner_policy::Preference;
use gleaner_units::{Action, ActionMask};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The networks and the state of the optimiser.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Ddqn<E: Encoding> {
    online: TrainedNetwork,
    target: Vec<f32>,
    #[serde(skip)]
    scratch: Scratch<E>,
}

/// Means over the batch of one update.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// Half the squared error.
    pub value: f32,
    /// Share of random actions.
    pub epsilon: f32,
}

impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "value {:.4}  epsilon {:.3}", self.value, self.epsilon)
    }
}

impl<E: Encoding> Algorithm for Ddqn<E> {
    type Encoding = E;
    type Losses = Losses;
    const NAME: &'static str = E::DDQN_NAME;

    fn new(_: &Settings, rng: &mut ChaCha8Rng) -> Ddqn<E> {
        let online = TrainedNetwork::new(&Self::network(), rng);
        Ddqn { target: online.parameters.clone(), online, scratch: Scratch::default() }
    }

    fn network() -> E::Network {
        E::network(VALUES)
    }

    fn policy_parameters(&self) -> &[f32] {
        &self.online.parameters
    }

    fn update(
        &mut self,
        encoding: &E,
        settings: &Settings,
        update: u64,
        transitions: &[&TransitionOf<E>],
        preferences: &[Preference],
    ) -> Losses {
        self.scratch.pack(encoding, transitions, preferences);
        let targets = self.targets(settings, transitions, preferences);
        let scale = 1.0 / preferences.len() as f32;
        let mut value = 0.0;
        self.online.zero_gradients();
        let Scratch { before, workspace, .. } = &mut self.scratch;
        Self::network().forward_backward(
            &self.online.parameters,
            before,
            workspace,
            |range, outputs, gradients| {
                gradients.fill(0.0);
                for (row, index) in range.enumerate() {
                    let action = transitions[index / settings.preferences].action.index();
                    for (objective, target) in targets[index].iter().enumerate() {
                        let at = row * VALUES + action * OBJECTIVES + objective;
                        let error = outputs[at] - target;
                        value += 0.5 * scale * error * error;
                        gradients[at] = scale * error;
                    }
                }
            },
            &mut self.online.gradients,
        );
        self.online.descend(settings.learning_rate_at(update));
        net::polyak(&mut self.target, &self.online.parameters, settings.polyak);
        Losses { value, epsilon: epsilon(settings, update) }
    }

    fn scores(values: &[f32], preference: Preference) -> [f32; ACTIONS] {
        scalarise(values, preference)
    }

    fn explore(settings: &Settings, update: u64, scores: &[f32; ACTIONS], mask: ActionMask) -> Distribution {
        Distribution::epsilon_greedy(epsilon(settings, update), scores, mask)
    }
}

fn epsilon(settings: &Settings, update: u64) -> f32 {
    interpolate(CONSTANTS.epsilon_start, CONSTANTS.epsilon_end, settings.annealed(update))
}

impl<E: Encoding> Ddqn<E> {
    /// y = r + gamma^n Q_target(s', argmax_a w . Q(s', a, w), w), per objective.
    fn targets(
        &mut self,
        settings: &Settings,
        transitions: &[&TransitionOf<E>],
        preferences: &[Preference],
    ) -> Vec<[f32; OBJECTIVES]> {
        let network = <Self as Algorithm>::network();
        let discount = bootstrap_discount(settings);
        let Scratch { after, workspace, .. } = &mut self.scratch;
        let online: Vec<[f32; VALUES]> =
            network.forward(&self.online.parameters, after, workspace).as_chunks().0.to_vec();
        let target = network.forward(&self.target, after, workspace).as_chunks::<VALUES>().0;
        let samples = preferences.iter().zip(online.iter().zip(target)).enumerate();
        samples
            .map(|(index, (&preference, (online, target)))| {
                let transition = transitions[index / settings.preferences];
                let mut returns = learning_reward::<E>(settings, transition);
                let next = transition.mask_after.argmax(&scalarise(online, preference));
                if let Some(next) = next.filter(|_| !transition.over) {
                    for (objective, value) in returns.iter_mut().enumerate() {
                        *value += discount * target[Action::index(next) * OBJECTIVES + objective];
                    }
                }
                returns
            })
            .collect()
    }
}
