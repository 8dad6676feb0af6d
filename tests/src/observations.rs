//! Observations to evaluate engines with.

use gleaner_host_trainer::env::flight::Flight;
use gleaner_host_trainer::judge::evaluation::{Network, realizations, test_preferences};
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::observe::tokens::normalise;
use gleaner_policy::schema::TERMINAL_UNITS;
use gleaner_policy::{K_MAX, LOCAL_MAP_CELLS, LOCAL_MAP_SIDE, Tokens};
use gleaner_units::ActionMask;
use gleaner_world::{ScenarioKind, World};
use rand::{Rng, RngExt};
use std::sync::Arc;

/// Random observations: number i has i mod 13 devices. Values exceed those of flights, so that clipping is exercised;
/// yields are multiples of 64 units, as everywhere, and every other map marks the terminal.
pub fn random(rng: &mut impl Rng, count: usize) -> Vec<Tokens> {
    let mut number = |low: f32, high: f32| low + (high - low) * rng.random::<f32>();
    (0..count)
        .map(|sample| {
            let w_data = number(0.0, 1.0);
            let device = |_| {
                let snr_db = number(-40.0, 35.0);
                let reachable = f32::from(u8::from(snr_db >= 5.0));
                let [east, north] = [number(-800.0, 800.0), number(-600.0, 600.0)];
                let vantage = [east + number(-140.0, 140.0), north + number(-140.0, 140.0)];
                [east, north, number(0.0, 8000.0), snr_db, reachable, vantage[0], vantage[1]]
            };
            let devices = (0..sample % (K_MAX + 1)).map(device).collect();
            // South-west of the aircraft.
            let mark = (sample % 2 == 0).then_some(LOCAL_MAP_CELLS / 2 - LOCAL_MAP_SIDE - 1);
            Tokens {
                uav: [number(0.0, 80.0), number(0.0, 80.0), number(-800.0, 800.0), number(-600.0, 600.0)],
                preference: [w_data, 1.0 - w_data],
                local_map: (0..LOCAL_MAP_CELLS)
                    .map(|cell| (cell, 64.0 * number(0.0, 256.0).floor()))
                    .map(|(cell, units)| if mark == Some(cell) { TERMINAL_UNITS } else { units })
                    .collect(),
                devices,
            }
        })
        .collect()
}

/// Observations and action masks of missions that the actor flies: both scenarios, 1 to 12 devices, all test
/// preferences, `count` of them.
///
/// # Panics
/// When a logit of the actor is not finite.
#[must_use]
pub fn flown(actor: &[f32], count: usize) -> Vec<(Tokens, ActionMask)> {
    let world = Arc::new(World::default_world());
    let mut network = Network::new(Shape::actor(), actor);
    let mut seen = Vec::new();
    for mission in 0.. {
        let scenario = ScenarioKind::ALL[mission % 2].scenario().with_devices(1 + mission % K_MAX);
        let drawn = realizations(&world, &scenario, 1 + mission as u64).expect("the scenario fits the city");
        let (seed, realization) = drawn.last().expect("one more than none");
        let flights = test_preferences().into_iter().map(|preference| {
            Flight::new(&world, realization, *seed, preference).expect("drawn for this world")
        });
        let mut flights: Vec<Flight> = flights.collect();
        while flights.iter().any(|flight| !flight.is_over()) {
            flights.retain(|flight| !flight.is_over());
            let tokens: Vec<Tokens> = flights.iter().map(Flight::tokens).collect();
            let logits = network.logits(tokens.iter().map(normalise));
            for ((flight, tokens), logits) in flights.iter_mut().zip(tokens).zip(logits) {
                let mask = flight.mask();
                seen.push((tokens, mask));
                flight.step(mask.argmax(&logits).expect("finite logits"));
            }
        }
        if seen.len() >= count {
            break;
        }
    }
    seen.truncate(count);
    seen
}
