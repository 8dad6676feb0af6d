//! The interface of the off-policy algorithms, and what they share: reward, trainable networks, batches.

use crate::env::distribution::{ACTIONS, Distribution};
use crate::learn::replay::Transition;
use crate::net::{Adam, Architecture, Samples};
use crate::observe::{BatchOf, Encoding, WorkspaceOf};
use crate::settings::Settings;
use gleaner_policy::{Attention, Preference};
use gleaner_units::ActionMask;
use rand_chacha::ChaCha8Rng;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fmt::{Debug, Display};

/// Objectives: data and energy.
pub(crate) const OBJECTIVES: usize = 2;
/// Outputs of a network of action values, index `action * OBJECTIVES + objective`.
pub(crate) const VALUES: usize = ACTIONS * OBJECTIVES;

/// A transition in the form that an encoding stores.
pub type TransitionOf<E> = Transition<<E as Encoding>::Observation>;

/// An off-policy algorithm: its networks and the state of their optimisers. The serialised form is all that the next
/// update depends on.
pub trait Algorithm: Debug + Sized + Serialize + DeserializeOwned {
    /// How it observes a flight.
    type Encoding: Encoding;
    /// The losses of an update: a JSON object in the learning curve, a short text on the console.
    type Losses: Clone + Debug + Display + Serialize;
    /// Name of the system in files and on the command line.
    const NAME: &'static str;

    /// Initialises the networks.
    fn new(settings: &Settings, rng: &mut ChaCha8Rng) -> Self;

    /// The network that selects actions.
    fn network() -> <Self::Encoding as Encoding>::Network;

    /// Parameters of the network that selects actions: what is evaluated, kept and exported.
    fn policy_parameters(&self) -> &[f32];

    /// One gradient step of all networks, number `update`. `preferences` holds [`Settings::preferences`] of them per
    /// transition.
    fn update(
        &mut self,
        encoding: &Self::Encoding,
        settings: &Settings,
        update: u64,
        transitions: &[&TransitionOf<Self::Encoding>],
        preferences: &[Preference],
    ) -> Self::Losses;

    /// Scores of the actions from the network's outputs. The policy takes the allowed action with the highest score.
    fn scores(outputs: &[f32], preference: Preference) -> [f32; ACTIONS];

    /// The behaviour policy during training.
    fn explore(settings: &Settings, update: u64, scores: &[f32; ACTIONS], mask: ActionMask) -> Distribution;
}

/// w . Q(s, a) for each action.
pub(crate) fn scalarise(values: &[f32], preference: Preference) -> [f32; ACTIONS] {
    std::array::from_fn(|action| {
        preference.w_data() * values[action * OBJECTIVES]
            + preference.w_energy() * values[action * OBJECTIVES + 1]
    })
}

/// The reward that the networks learn from: scaled, with the potential-based shaping of the energy objective. The
/// potential is zero on the terminal, so the end of a mission needs no special case.
pub(crate) fn learning_reward<E: Encoding>(
    settings: &Settings,
    transition: &TransitionOf<E>,
) -> [f32; OBJECTIVES] {
    let [data, energy] = transition.reward;
    let potential = |state: &E::Observation| -settings.shaping * E::distance_to_terminal(state);
    let shaped =
        energy + bootstrap_discount(settings) * potential(&transition.after) - potential(&transition.before);
    [data, shaped].map(|reward| reward * settings.reward_scale)
}

/// gamma^n: the weight of the state value at the end of an n-step transition.
pub(crate) fn bootstrap_discount(settings: &Settings) -> f32 {
    (0..settings.n_step).fold(1.0, |product, _| product * settings.discount)
}

/// One network under training.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TrainedNetwork {
    pub parameters: Vec<f32>,
    pub adam: Adam,
    #[serde(skip)]
    pub gradients: Vec<f32>,
}

impl TrainedNetwork {
    pub fn new(network: &impl Architecture, rng: &mut ChaCha8Rng) -> TrainedNetwork {
        let parameters = network.initialise(rng);
        TrainedNetwork { adam: Adam::new(parameters.len(), 0.0), gradients: Vec::new(), parameters }
    }

    pub fn zero_gradients(&mut self) {
        self.gradients.clear();
        self.gradients.resize(self.parameters.len(), 0.0);
    }

    pub fn descend(&mut self, learning_rate: f32) {
        self.adam.lr = learning_rate;
        self.adam.step(&mut self.parameters, &self.gradients);
    }
}

/// Buffers of an update, kept to save allocations.
#[derive(Clone, Debug)]
pub(crate) struct Scratch<E: Encoding> {
    pub before: BatchOf<E>,
    pub after: BatchOf<E>,
    pub workspace: WorkspaceOf<E>,
}

impl<E: Encoding> Default for Scratch<E> {
    fn default() -> Self {
        Self { before: Default::default(), after: Default::default(), workspace: Default::default() }
    }
}

impl<E: Encoding> Scratch<E> {
    /// Packs both states of each transition under its preferences.
    pub fn pack(&mut self, encoding: &E, transitions: &[&TransitionOf<E>], preferences: &[Preference]) {
        self.before.clear();
        self.after.clear();
        let copies = preferences.len() / transitions.len().max(1);
        for (transition, preferences) in transitions.iter().zip(preferences.chunks(copies.max(1))) {
            encoding.push(&transition.before, preferences, &mut self.before);
            encoding.push(&transition.after, preferences, &mut self.after);
        }
    }
}

/// Forward passes of a network over batches of states.
#[derive(Clone, Debug)]
pub struct Inference<E: Encoding> {
    network: E::Network,
    batch: BatchOf<E>,
    workspace: WorkspaceOf<E>,
}

impl<E: Encoding> Inference<E> {
    /// Buffers for this network.
    #[must_use]
    pub fn new(network: E::Network) -> Inference<E> {
        Inference { network, batch: Default::default(), workspace: Default::default() }
    }

    /// The outputs, `[states, outputs]`.
    pub fn outputs<'s>(
        &mut self,
        encoding: &E,
        parameters: &[f32],
        states: impl IntoIterator<Item = (&'s E::Observation, Preference)>,
    ) -> &[f32]
    where
        E::Observation: 's,
    {
        self.batch.clear();
        for (state, preference) in states {
            encoding.push(state, &[preference], &mut self.batch);
        }
        self.network.forward(parameters, &self.batch, &mut self.workspace)
    }

    /// Attention in the last layer, if the last call of [`Inference::outputs`] had one state. `None` for a network without
    /// attention.
    #[must_use]
    pub fn attention(&self) -> Option<Attention> {
        E::Network::attention(&self.workspace).map(Attention)
    }
}
