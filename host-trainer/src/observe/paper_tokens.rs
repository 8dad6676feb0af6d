//! The set of tokens of the paper (section III-C): aircraft, devices, preference, and the buildings around.
//!
//! What the policy that flies sees is this with a yield map in the place of the buildings and the vantage of each
//! device. Here is what the paper has, so that its results can be reproduced and the two compared.

use crate::env::flight::Flight;
use crate::net::{Batch, LOCAL_SIDE, Shape, VECTOR_DEVICE_FEATURES};
use crate::observe::encoding::{Encoding, weights};
use crate::observe::maps::{height, local_cell};
use crate::observe::tokens::way_to_terminal;
use crate::systems::System;
use gleaner_policy::Preference;
use gleaner_units::{Cell, HeightMap};
use gleaner_world::World;
use serde::{Deserialize, Serialize};

/// Numbers of a device.
const DEVICE: usize = VECTOR_DEVICE_FEATURES;

/// The paper's tokens in one city.
#[derive(Clone, Debug)]
pub struct PaperTokens {
    heights: HeightMap,
}

/// What the replay memory keeps: the city knows the buildings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    cell: Cell,
    uav: [f32; 4],
    devices: Vec<[f32; DEVICE]>,
}

impl Encoding for PaperTokens {
    type Observation = Seen;
    type Network = Shape;
    const MOSAC: System = System::MosacAtt;

    fn network(outputs: usize) -> Shape {
        Shape::paper(outputs)
    }

    fn of(world: &World) -> PaperTokens {
        PaperTokens { heights: world.city().heights().clone() }
    }

    fn observe(&self, flight: &Flight) -> Seen {
        let sample = flight.sample();
        let devices = sample.devices_present().iter().filter_map(|device| device.first_chunk());
        Seen { cell: flight.episode().uav(), uav: sample.uav, devices: devices.copied().collect() }
    }

    fn push(&self, seen: &Seen, preferences: &[Preference], batch: &mut Batch) {
        let buildings: [f32; LOCAL_SIDE * LOCAL_SIDE] =
            std::array::from_fn(|index| height(&self.heights, local_cell(seen.cell, index)));
        for &preference in preferences {
            batch.push(&seen.uav, &weights(preference), &buildings, &seen.devices);
        }
    }

    fn way_to_terminal(seen: &Seen) -> f32 {
        way_to_terminal(seen.uav[0], seen.uav[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::Action;
    use gleaner_world::{Realization, Scenario, Seed};
    use std::sync::Arc;

    #[test]
    fn buildings_and_devices_are_the_paper_s() {
        let world = Arc::new(World::default_world());
        let seed = Seed::evaluation(2);
        let realization = Realization::draw(world.city(), &Scenario::reach_destination(), seed).unwrap();
        let mut flight = Flight::new(&world, &realization, seed, Preference::DATA).unwrap();
        flight.step(Action::East);
        let tokens = PaperTokens::of(&world);
        let seen = tokens.observe(&flight);
        let plain = flight.sample();
        assert_eq!((seen.uav, seen.devices.len()), (plain.uav, 6));
        assert!(seen.devices.iter().zip(plain.devices).all(|(ours, flies)| *ours == flies[..DEVICE]));
        let Cell { x, y } = flight.episode().uav();
        let heights = world.city().heights();
        for (index, east, north) in [(0, -5, -5), (55, 0, 0), (99, 4, 4), (90, -5, 4)] {
            assert_eq!(local_cell(seen.cell, index), Cell::new(x + east, y + north));
            let expected =
                heights.height(Cell::new(x + east, y + north)).map_or(1.0, |height| height.0 / 50.0);
            assert_eq!(height(heights, local_cell(seen.cell, index)), expected);
        }
    }
}
