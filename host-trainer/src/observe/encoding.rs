//! How a system sees a flight: what it remembers of a state, and how it shows that to its network.

use crate::env::flight::Flight;
use crate::net::{
    Architecture, Batch, Shape, VECTOR_DEVICE_FEATURES, VECTOR_FEATURES, VectorBatch, VectorShape,
};
use crate::observe::tokens::{Observation, way_to_terminal};
use crate::systems::System;
use gleaner_policy::Preference;
use gleaner_world::World;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// One of the paper's state representations (section III-C) with the network that reads it.
pub trait Encoding: Debug {
    /// What the replay memory keeps of a state: without the preference, and without what the world can tell again.
    type Observation: Clone + Debug + PartialEq + Serialize + DeserializeOwned;
    /// What reads it.
    type Network: Architecture;
    /// The system that soft actor-critic and this encoding make.
    const MOSAC: System;

    /// The network with so many outputs.
    fn network(outputs: usize) -> Self::Network {
        Self::Network::with_outputs(outputs)
    }

    /// The encoding of flights in this world.
    fn of(world: &World) -> Self;

    /// The present state.
    fn observe(&self, flight: &Flight) -> Self::Observation;

    /// Appends a state to a batch, once under each of the preferences.
    fn push(&self, seen: &Self::Observation, preferences: &[Preference], batch: &mut BatchOf<Self>);

    /// Battery units that the way to the terminal takes.
    fn way_to_terminal(seen: &Self::Observation) -> f32;
}

/// The batches of an encoding's network.
pub type BatchOf<E> = <<E as Encoding>::Network as Architecture>::Batch;
/// The memory of an encoding's network.
pub type WorkspaceOf<E> = <<E as Encoding>::Network as Architecture>::Workspace;

/// The weights of a preference as the networks read them.
pub(crate) fn weights(preference: Preference) -> [f32; 2] {
    [preference.w_data(), preference.w_energy()]
}

/// The set of tokens that flies.
#[derive(Clone, Copy, Debug)]
pub struct Attention;

impl Encoding for Attention {
    type Observation = Observation;
    type Network = Shape;
    const MOSAC: System = System::Gleaner;

    fn of(_: &World) -> Attention {
        Attention
    }

    fn observe(&self, flight: &Flight) -> Observation {
        flight.observe()
    }

    fn push(&self, seen: &Observation, preferences: &[Preference], batch: &mut Batch) {
        let mut sample = seen.with(Preference::ENERGY);
        for &preference in preferences {
            sample.preference = weights(preference);
            batch.push_sample(&sample);
        }
    }

    fn way_to_terminal(seen: &Observation) -> f32 {
        seen.way_to_terminal()
    }
}

/// The numbers of the same tokens, without the map, side by side (paper, eq. 15). The paper fixes K; here there is a
/// place for each of the K_max devices, and those that are absent are zeros.
#[derive(Clone, Copy, Debug)]
pub struct FeatureVector;

/// The numbers of the aircraft and of the devices that are present, normalised.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Features(Vec<f32>);

impl Encoding for FeatureVector {
    type Observation = Features;
    type Network = VectorShape;
    const MOSAC: System = System::MosacFtv;

    fn of(_: &World) -> FeatureVector {
        FeatureVector
    }

    fn observe(&self, flight: &Flight) -> Features {
        let sample = flight.sample();
        let devices = sample.devices_present().iter().flat_map(|device| &device[..VECTOR_DEVICE_FEATURES]);
        Features(sample.uav.iter().chain(devices).copied().collect())
    }

    fn push(&self, seen: &Features, preferences: &[Preference], batch: &mut VectorBatch) {
        let mut numbers = [0.0; VECTOR_FEATURES];
        numbers[..seen.0.len()].copy_from_slice(&seen.0);
        let preferences: Vec<_> = preferences.iter().copied().map(weights).collect();
        batch.push(&numbers, &preferences);
    }

    fn way_to_terminal(seen: &Features) -> f32 {
        way_to_terminal(seen.0[0], seen.0[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::learner::{Asked, Gleaner, Learner, MosacAtt, MosacCgl, MosacFtv};
    use gleaner_units::Action;
    use gleaner_world::{Realization, Scenario, Seed};
    use rand::SeedableRng;
    use std::sync::Arc;

    fn flight(devices: usize) -> Flight {
        let world = Arc::new(World::default_world());
        let scenario = Scenario::reach_destination().with_devices(devices);
        let realization = Realization::draw(world.city(), &scenario, Seed::evaluation(1)).unwrap();
        let mut flight = Flight::new(&world, &realization, Seed::evaluation(1), Preference::DATA).unwrap();
        flight.step(Action::East);
        flight
    }

    #[test]
    fn a_feature_vector_is_the_numbers_of_the_tokens_and_zeros() {
        for devices in [0, 6, 12] {
            let flight = flight(devices);
            let Features(numbers) = FeatureVector.observe(&flight);
            assert_eq!(numbers.len(), 4 + 5 * devices);
            let tokens = crate::observe::tokens::normalise(&flight.tokens());
            assert_eq!(numbers[..4], tokens.uav);
            for (place, device) in numbers[4..].chunks(5).zip(tokens.devices_present()) {
                assert_eq!(place, &device[..5]);
            }
        }
    }

    /// Under every encoding 31 moves are left and the answer depends on the preference.
    fn sees<L: Learner>() {
        let flight = flight(6);
        let encoding = L::Encoding::of(flight.episode().world());
        let seen = encoding.observe(&flight);
        assert_eq!(L::Encoding::way_to_terminal(&seen), 31.0, "{}", L::SYSTEM);
        let parameters = L::network().initialise(&mut rand_chacha::ChaCha8Rng::seed_from_u64(1));
        let mut asked = Asked::<L::Encoding>::new(L::network());
        let states = [(&seen, Preference::DATA), (&seen, Preference::ENERGY), (&seen, Preference::DATA)];
        let answers = asked.answer(&encoding, &parameters, states).to_vec();
        let [data, energy, again] = [0, 1, 2].map(|row| &answers[row * 5..row * 5 + 5]);
        assert_eq!(data, again, "{}", L::SYSTEM);
        assert_ne!(data, energy, "{}", L::SYSTEM);
    }

    #[test]
    fn every_encoding_sees_the_way_home_and_the_preference() {
        sees::<Gleaner>();
        sees::<MosacAtt>();
        sees::<MosacCgl>();
        sees::<MosacFtv>();
    }
}
