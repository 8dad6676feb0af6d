//! Observations for unit tests.

use crate::{K_MAX, LOCAL_MAP_CELLS, Tokens};

/// Seeded observations; number i has i mod 13 devices. Values exceed those of flights, so that clipping is exercised.
pub(crate) fn observations(count: usize) -> Vec<Tokens> {
    let mut state = 404_u64;
    // Knuth's linear congruential generator.
    let mut number = |low: f32, high: f32| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((state >> 40) as f32 / (1 << 24) as f32)
    };
    let drawn = |sample: usize| Tokens {
        uav: [number(0.0, 80.0), number(0.0, 80.0), number(-800.0, 800.0), number(-600.0, 600.0)],
        preference: [0.25, 0.75],
        local_map: (0..LOCAL_MAP_CELLS).map(|_| 64.0 * number(0.0, 256.0).floor()).collect(),
        devices: (0..sample % (K_MAX + 1))
            .map(|_| {
                let [east, north] = [number(-800.0, 800.0), number(-600.0, 600.0)];
                [east, north, number(0.0, 8000.0), number(-40.0, 35.0), 1.0, east + 40.0, north - 40.0]
            })
            .collect(),
    };
    (0..count).map(drawn).collect()
}
