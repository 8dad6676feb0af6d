//! The paper's set of tokens (section III-C): aircraft, devices, preference, and the building heights around.
//!
//! The tokens of the shipped policy differ in two points: a yield map instead of the heights, and the vantage point of
//! each device. This encoding is the paper's, to reproduce its results and to compare the two.

use crate::env::flight::Flight;
use crate::net::{Batch, LOCAL_SIDE, Shape, UAV_FEATURES, VECTOR_DEVICE_FEATURES};
use crate::observe::maps::{height, local_cell};
use crate::observe::tokens::{self, distance_to_terminal};
use crate::observe::{Encoding, weights};
use gleaner_policy::Preference;
use gleaner_units::{Cell, HeightMap};
use gleaner_world::City;
use serde::{Deserialize, Serialize};

/// Features of a device: offset, remaining data, SNR, reachable.
pub(crate) const DEVICE_FEATURES: usize = VECTOR_DEVICE_FEATURES;

/// The paper's tokens in one city.
#[derive(Clone, Debug)]
pub struct PaperTokens {
    heights: HeightMap,
}

/// What the replay memory stores: the heights follow from the cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PaperState {
    pub(crate) cell: Cell,
    pub(crate) uav: [f32; UAV_FEATURES],
    pub(crate) devices: Vec<[f32; DEVICE_FEATURES]>,
}

impl PaperState {
    /// The current state of a flight.
    pub(crate) fn of(flight: &Flight) -> PaperState {
        let sample = tokens::sample(flight);
        let devices = sample.devices_present().iter().filter_map(|device| device.first_chunk());
        PaperState { cell: flight.episode().uav(), uav: sample.uav, devices: devices.copied().collect() }
    }
}

impl Encoding for PaperTokens {
    type Observation = PaperState;
    type Network = Shape;
    const MOSAC_NAME: &'static str = "mosac-att";

    fn network(outputs: usize) -> Shape {
        Shape::paper(outputs)
    }

    fn of(city: &City) -> PaperTokens {
        PaperTokens { heights: city.heights().clone() }
    }

    fn observe(&self, flight: &Flight) -> PaperState {
        PaperState::of(flight)
    }

    fn push(&self, state: &PaperState, preferences: &[Preference], batch: &mut Batch) {
        let heights: [f32; LOCAL_SIDE * LOCAL_SIDE] =
            std::array::from_fn(|index| height(&self.heights, local_cell(state.cell, index)));
        for &preference in preferences {
            batch.push(&state.uav, &weights(preference), &heights, &state.devices);
        }
    }

    fn distance_to_terminal(state: &PaperState) -> f32 {
        distance_to_terminal(&state.uav)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::Action;
    use gleaner_world::{Realization, Scenario, Seed, World};
    use std::sync::Arc;

    #[test]
    fn local_map_and_devices_follow_the_paper() {
        let world = Arc::new(World::default_world());
        let seed = Seed::evaluation(2);
        let realization = Realization::draw(world.city(), &Scenario::reach_destination(), seed).unwrap();
        let mut flight = Flight::new(&world, &realization, seed, Preference::DATA).unwrap();
        flight.step(Action::East);
        let state = PaperTokens::of(world.city()).observe(&flight);
        let plain = tokens::sample(&flight);
        assert_eq!((state.uav, state.devices.len()), (plain.uav, 6));
        let pairs = state.devices.iter().zip(plain.devices);
        assert!(pairs.into_iter().all(|(paper, shipped)| *paper == shipped[..DEVICE_FEATURES]));
        let Cell { x, y } = flight.episode().uav();
        let heights = world.city().heights();
        for (index, east, north) in [(0, -5, -5), (55, 0, 0), (99, 4, 4), (90, -5, 4)] {
            assert_eq!(local_cell(state.cell, index), Cell::new(x + east, y + north));
            let expected =
                heights.height(Cell::new(x + east, y + north)).map_or(1.0, |height| height.0 / 50.0);
            assert_eq!(height(heights, local_cell(state.cell, index)), expected);
        }
    }
}
