//! Double deep Q-network (van Hasselt, Guez and Silver 2016) with vector values: the paper's DDQN-CGL.
//!
//! The paper takes the network of Theile et al. and concatenates the preference; its value functions are vectors
//! conditioned on the preference (section IV-A, after Abels et al. 2019), and all its algorithms share learning rate,
//! batch, replay and J = 3 preferences a transition (section V-B). So here: one network of values `Q(s, a, w)` for
//! both objectives, the online network choosing the next action by `w . Q`, the slow one judging it, and the same
//! squared error per objective as the critics of MOSAC (eq. 16). Actions that the guard forbids are neither taken nor
//! chosen in targets. The paper says nothing of exploration: here epsilon-greedy, falling over the same updates as
//! MOSAC's heat.

use crate::learn::learner::{
    self, ACTIONS, OBJECTIVES, Remembered, Scratch, Trained, VALUES, scalarise, seen_reward,
};
use crate::learn::mosac::Distribution;
use crate::learn::settings::{Settings, mix};
use crate::net::{self, Architecture};
use crate::observe::encoding::Encoding;
use crate::systems::System;
use gleaner_policy::Preference;
use gleaner_units::{Action, ActionMask};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Share of random actions at the start and after the annealing.
const EPSILON: (f32, f32) = (1.0, 0.05);

/// The networks and what is needed to go on learning.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Learner<E: Encoding> {
    values: Trained,
    slow: Vec<f32>,
    #[serde(skip)]
    scratch: Scratch<E>,
}

/// What an update saw: means over the batch.
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

impl<E: Encoding> learner::Learner for Learner<E> {
    type Encoding = E;
    type Losses = Losses;
    const SYSTEM: System = System::DdqnCgl;

    fn new(_: &Settings, rng: &mut ChaCha8Rng) -> Learner<E> {
        let values = Trained::new(&Self::network(), rng);
        Learner { slow: values.parameters.clone(), values, scratch: Scratch::default() }
    }

    fn network() -> E::Network {
        E::network(VALUES)
    }

    fn deciding(&self) -> &[f32] {
        &self.values.parameters
    }

    fn update(
        &mut self,
        encoding: &E,
        settings: &Settings,
        update: u64,
        transitions: &[&Remembered<E>],
        preferences: &[Preference],
    ) -> Losses {
        self.scratch.pack(encoding, transitions, preferences);
        let targets = self.targets(settings, transitions, preferences);
        let scale = 1.0 / preferences.len() as f32;
        let mut value = 0.0;
        self.values.zero_gradients();
        let Scratch { before, workspace, .. } = &mut self.scratch;
        Self::network().forward_backward(
            &self.values.parameters,
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
            &mut self.values.gradients,
        );
        self.values.descend(settings.learning_rate_at(update));
        net::polyak(&mut self.slow, &self.values.parameters, settings.polyak);
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
    mix(EPSILON.0, EPSILON.1, settings.annealed(update))
}

impl<E: Encoding> Learner<E> {
    /// y = r + gamma Q_slow(s', argmax_a w . Q(s', a, w), w), per objective.
    fn targets(
        &mut self,
        settings: &Settings,
        transitions: &[&Remembered<E>],
        preferences: &[Preference],
    ) -> Vec<[f32; OBJECTIVES]> {
        let network = <Self as learner::Learner>::network();
        let Scratch { after, workspace, .. } = &mut self.scratch;
        let own: Vec<[f32; VALUES]> =
            network.forward(&self.values.parameters, after, workspace).as_chunks().0.to_vec();
        let slow = network.forward(&self.slow, after, workspace).as_chunks::<VALUES>().0;
        let samples = preferences.iter().zip(own.iter().zip(slow)).enumerate();
        samples
            .map(|(index, (&preference, (own, slow)))| {
                let transition = transitions[index / settings.preferences];
                let mut target = seen_reward::<E>(settings, transition);
                let next = transition.mask_after.argmax(&scalarise(own, preference));
                if let Some(next) = next.filter(|_| !transition.over) {
                    for (objective, target) in target.iter_mut().enumerate() {
                        *target += settings.discount * slow[Action::index(next) * OBJECTIVES + objective];
                    }
                }
                target
            })
            .collect()
    }
}
