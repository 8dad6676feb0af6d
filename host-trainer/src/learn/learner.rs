//! What the training loop asks of a learning algorithm, whatever it learns and however it sees.

use crate::learn::ddqn;
use crate::learn::mosac::{self, Distribution};
use crate::learn::replay::Transition;
use crate::learn::settings::Settings;
use crate::net::{Adam, Architecture, Samples};
use crate::observe::encoding::{Attention, BatchOf, Encoding, FeatureVector, WorkspaceOf};
use crate::observe::maps::Maps;
use crate::observe::paper_tokens::PaperTokens;
use crate::systems::System;
use gleaner_policy::Preference;
use gleaner_units::{Action, ActionMask};
use rand_chacha::ChaCha8Rng;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fmt::{Debug, Display};

/// Soft actor-critic with attention on what the policy that flies sees.
pub type Gleaner = mosac::Learner<Attention>;
/// Soft actor-critic with attention on what the paper's policy sees.
pub type MosacAtt = mosac::Learner<PaperTokens>;
/// Soft actor-critic on centred maps.
pub type MosacCgl = mosac::Learner<Maps>;
/// Soft actor-critic on a feature vector.
pub type MosacFtv = mosac::Learner<FeatureVector>;
/// Double deep Q-network on centred maps.
pub type DdqnCgl = ddqn::Learner<Maps>;

/// Actions of a decision.
pub(crate) const ACTIONS: usize = Action::COUNT;
/// Data and energy.
pub(crate) const OBJECTIVES: usize = 2;
/// Outputs of a network of values: `action * OBJECTIVES + objective`.
pub(crate) const VALUES: usize = ACTIONS * OBJECTIVES;

/// A transition as an encoding remembers it.
pub type Remembered<E> = Transition<<E as Encoding>::Observation>;

/// A learning algorithm: its networks and what is needed to go on learning. What is serialised is all that the next
/// update depends on.
pub trait Learner: Debug + Sized + Serialize + DeserializeOwned {
    /// How it sees.
    type Encoding: Encoding;
    /// What an update tells: a JSON object in the learning curve, and a few words for people.
    type Losses: Clone + Debug + Display + Serialize;
    /// Its name.
    const SYSTEM: System;

    /// Fresh networks.
    fn new(settings: &Settings, rng: &mut ChaCha8Rng) -> Self;

    /// The network that decides.
    fn network() -> <Self::Encoding as Encoding>::Network;

    /// The parameters of the network that decides: what is judged, kept and exported.
    fn deciding(&self) -> &[f32];

    /// One gradient step of everything, the `update`th. `preferences` holds [`Settings::preferences`] of them per
    /// transition.
    fn update(
        &mut self,
        encoding: &Self::Encoding,
        settings: &Settings,
        update: u64,
        transitions: &[&Remembered<Self::Encoding>],
        preferences: &[Preference],
    ) -> Self::Losses;

    /// What the network's answer says of each action: the allowed one with the highest score is what it decides.
    fn scores(answer: &[f32], preference: Preference) -> [f32; ACTIONS];

    /// How an action is drawn while learning.
    fn explore(settings: &Settings, update: u64, scores: &[f32; ACTIONS], mask: ActionMask) -> Distribution;
}

/// `w . Q` for each action.
pub(crate) fn scalarise(values: &[f32], preference: Preference) -> [f32; ACTIONS] {
    std::array::from_fn(|action| {
        preference.w_data() * values[action * OBJECTIVES]
            + preference.w_energy() * values[action * OBJECTIVES + 1]
    })
}

/// The reward as the learners see it: scaled, and the energy shaped by the way to the terminal. On the terminal the
/// way is zero, so the end of a mission needs no case of its own.
pub(crate) fn seen_reward<E: Encoding>(settings: &Settings, transition: &Remembered<E>) -> [f32; OBJECTIVES] {
    let [data, energy] = transition.reward;
    let potential = |seen: &E::Observation| -settings.shaping * E::way_to_terminal(seen);
    let shaped = energy + settings.discount * potential(&transition.after) - potential(&transition.before);
    [data, shaped].map(|reward| reward * settings.reward_scale)
}

/// One network under training.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Trained {
    pub parameters: Vec<f32>,
    pub adam: Adam,
    #[serde(skip)]
    pub gradients: Vec<f32>,
}

impl Trained {
    pub fn new(network: &impl Architecture, rng: &mut ChaCha8Rng) -> Trained {
        let parameters = network.initialise(rng);
        Trained { adam: Adam::new(parameters.len(), 0.0), gradients: Vec::new(), parameters }
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

/// The memory of an update, kept from one to the next.
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
    /// Packs both ends of each transition under its preferences.
    pub fn pack(&mut self, encoding: &E, transitions: &[&Remembered<E>], preferences: &[Preference]) {
        self.before.clear();
        self.after.clear();
        let copies = preferences.len() / transitions.len().max(1);
        for (transition, preferences) in transitions.iter().zip(preferences.chunks(copies.max(1))) {
            encoding.push(&transition.before, preferences, &mut self.before);
            encoding.push(&transition.after, preferences, &mut self.after);
        }
    }
}

/// A network that is asked in batches.
#[derive(Clone, Debug)]
pub struct Asked<E: Encoding> {
    network: E::Network,
    batch: BatchOf<E>,
    workspace: WorkspaceOf<E>,
}

impl<E: Encoding> Asked<E> {
    /// To be asked in batches.
    #[must_use]
    pub fn new(network: E::Network) -> Asked<E> {
        Asked { network, batch: Default::default(), workspace: Default::default() }
    }

    /// Its answers, `[states, outputs]`.
    pub fn answer<'s>(
        &mut self,
        encoding: &E,
        parameters: &[f32],
        states: impl IntoIterator<Item = (&'s E::Observation, Preference)>,
    ) -> &[f32]
    where
        E::Observation: 's,
    {
        self.batch.clear();
        for (seen, preference) in states {
            encoding.push(seen, &[preference], &mut self.batch);
        }
        self.network.forward(parameters, &self.batch, &mut self.workspace)
    }
}
