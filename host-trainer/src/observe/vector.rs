//! The feature vector of MOSAC-FTV: the features of the tokens side by side, without the map (paper, eq. 15).
//!
//! The paper fixes K. Here the vector has a place for each of the K_max devices, zero where a device is absent.

use crate::env::flight::Flight;
use crate::net::{UAV_FEATURES, VECTOR_DEVICE_FEATURES, VECTOR_FEATURES, VectorBatch, VectorShape};
use crate::observe::tokens::{self, distance_to_terminal};
use crate::observe::{Encoding, weights};
use gleaner_policy::Preference;
use gleaner_world::City;
use serde::{Deserialize, Serialize};

/// The encoding.
#[derive(Clone, Copy, Debug)]
pub struct FeatureVector;

/// Normalised features of the aircraft and of the devices that are present.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Features(Vec<f32>);

impl Encoding for FeatureVector {
    type Observation = Features;
    type Network = VectorShape;
    const MOSAC_NAME: &'static str = "mosac-ftv";

    fn of(_: &City) -> FeatureVector {
        FeatureVector
    }

    fn observe(&self, flight: &Flight) -> Features {
        let sample = tokens::sample(flight);
        let devices = sample.devices_present().iter().flat_map(|device| &device[..VECTOR_DEVICE_FEATURES]);
        Features(sample.uav.iter().chain(devices).copied().collect())
    }

    fn push(&self, state: &Features, preferences: &[Preference], batch: &mut VectorBatch) {
        let mut features = [0.0; VECTOR_FEATURES];
        features[..state.0.len()].copy_from_slice(&state.0);
        let preferences: Vec<_> = preferences.iter().copied().map(weights).collect();
        batch.push(&features, &preferences);
    }

    fn distance_to_terminal(state: &Features) -> f32 {
        state.0.first_chunk::<UAV_FEATURES>().map_or(0.0, distance_to_terminal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::Action;
    use gleaner_world::{Realization, Scenario, Seed, World};
    use std::sync::Arc;

    #[test]
    fn features_are_those_of_the_tokens() {
        let world = Arc::new(World::default_world());
        for devices in [0, 6, 12] {
            let scenario = Scenario::reach_destination().with_devices(devices);
            let realization = Realization::draw(world.city(), &scenario, Seed::evaluation(1)).unwrap();
            let mut flight =
                Flight::new(&world, &realization, Seed::evaluation(1), Preference::DATA).unwrap();
            flight.step(Action::East);
            let Features(features) = FeatureVector.observe(&flight);
            assert_eq!(features.len(), 4 + 5 * devices);
            let tokens = tokens::sample(&flight);
            assert_eq!(features[..4], tokens.uav);
            for (place, device) in features[4..].chunks(5).zip(tokens.devices_present()) {
                assert_eq!(place, &device[..5]);
            }
        }
    }
}
