//! The paper's set of tokens with all four layers of the local map S^CL: heights, zones, remaining data, position.
//!
//! The paper's text defines four layers (section III-C) and does not say which of them enter the local-map token. The
//! other encoding, [`crate::observe::paper_tokens`], gives the network the heights only, since zones, data and position
//! are in the other tokens already. `train --local-map four-layers` selects this one.

use crate::env::flight::Flight;
use crate::net::{Batch, LOCAL_NUMBERS, Shape};
use crate::observe::maps::{Maps, Scene};
use crate::observe::paper_tokens::PaperState;
use crate::observe::tokens::distance_to_terminal;
use crate::observe::{Encoding, weights};
use gleaner_policy::Preference;
use gleaner_world::City;
use serde::{Deserialize, Serialize};

/// The paper's tokens with four map layers in one city.
#[derive(Clone, Debug)]
pub struct LayeredTokens {
    maps: Maps,
}

/// What the replay memory stores: the token features, and what the map is drawn from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayeredState {
    tokens: PaperState,
    scene: Scene,
}

impl Encoding for LayeredTokens {
    type Observation = LayeredState;
    type Network = Shape;
    const MOSAC_NAME: &'static str = "mosac-att-four-layers";

    fn network(outputs: usize) -> Shape {
        Shape { map_cells: LOCAL_NUMBERS, ..Shape::paper(outputs) }
    }

    fn of(city: &City) -> LayeredTokens {
        LayeredTokens { maps: Maps::of(city) }
    }

    fn observe(&self, flight: &Flight) -> LayeredState {
        LayeredState { tokens: PaperState::of(flight), scene: Scene::of(flight) }
    }

    fn push(&self, state: &LayeredState, preferences: &[Preference], batch: &mut Batch) {
        let mut map = [0.0; LOCAL_NUMBERS];
        self.maps.draw_local(&state.scene, &mut map);
        for &preference in preferences {
            batch.push(&state.tokens.uav, &weights(preference), &map, &state.tokens.devices);
        }
    }

    fn distance_to_terminal(state: &LayeredState) -> f32 {
        distance_to_terminal(&state.tokens.uav)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::net::{MAP_CHANNELS, MapBatch};
    use gleaner_world::{Realization, Scenario, Seed, World};
    use std::sync::Arc;

    #[test]
    fn local_map_is_that_of_the_map_systems() {
        let world = Arc::new(World::default_world());
        let seed = Seed::evaluation(2);
        let realization = Realization::draw(world.city(), &Scenario::return_base(), seed).unwrap();
        let flight = Flight::new(&world, &realization, seed, Preference::DATA).unwrap();
        let encoding = LayeredTokens::of(world.city());
        let state = encoding.observe(&flight);
        let mut map = [0.0; LOCAL_NUMBERS];
        encoding.maps.draw_local(&state.scene, &mut map);
        let mut batch = MapBatch::default();
        encoding.maps.push(&state.scene, &[Preference::DATA], &mut batch);
        assert_eq!(map[..], batch.last().unwrap().0[..]);
        let position = map.chunks_exact(MAP_CHANNELS).map(|cell| cell[3]).sum::<f32>();
        assert_eq!(position, 1.0, "the aircraft is in the middle");
    }
}
