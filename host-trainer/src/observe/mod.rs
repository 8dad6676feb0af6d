//! Encodings: how a system observes a flight, and how a state enters its network.

pub mod layers;
pub mod maps;
pub mod paper_tokens;
pub mod tokens;
pub mod vector;

use crate::env::flight::Flight;
use crate::net::Architecture;
use gleaner_policy::Preference;
use gleaner_world::City;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;

/// A state representation (paper, section III-C) and the network that reads it.
pub trait Encoding: Debug {
    /// What the replay memory stores of a state: without the preference, and without what the world determines.
    type Observation: Clone + Debug + PartialEq + Serialize + DeserializeOwned;
    /// The network that reads it.
    type Network: Architecture;
    /// Name of soft actor-critic with this encoding.
    const MOSAC_NAME: &'static str;
    /// Name of the double deep Q-network with this encoding; empty where there is no such system.
    const DDQN_NAME: &'static str = "";

    /// The network with this number of outputs.
    fn network(outputs: usize) -> Self::Network {
        Self::Network::with_outputs(outputs)
    }

    /// The encoding for flights over this city, as far as the policy knows it.
    fn of(city: &City) -> Self;

    /// The current state.
    fn observe(&self, flight: &Flight) -> Self::Observation;

    /// Appends a state to a batch, once for each preference.
    fn push(&self, state: &Self::Observation, preferences: &[Preference], batch: &mut BatchOf<Self>);

    /// Moves to the terminal, which is also the battery they need in units.
    fn distance_to_terminal(state: &Self::Observation) -> f32;
}

/// The batches of an encoding's network.
pub type BatchOf<E> = <<E as Encoding>::Network as Architecture>::Batch;
/// The workspace of an encoding's network.
pub type WorkspaceOf<E> = <<E as Encoding>::Network as Architecture>::Workspace;

/// The weights of a preference in the order of the network's inputs.
pub(crate) fn weights(preference: Preference) -> [f32; 2] {
    [preference.w_data(), preference.w_energy()]
}
