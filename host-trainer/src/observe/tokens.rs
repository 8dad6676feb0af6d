//! The set of tokens of the shipped policy, normalised for the network's first layer.

use crate::env::flight::Flight;
use crate::net::{Batch, DEVICE_FEATURES, DeviceFeatures, Sample, Shape, UAV_FEATURES};
use crate::observe::{Encoding, weights};
use gleaner_policy::schema::{self, Normalisation};
use gleaner_policy::{LOCAL_MAP_CELLS, Preference, Tokens};
use gleaner_world::City;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// What the replay memory stores of a state: all but the preference, small enough for 100,000 of them. Normalised,
/// except for the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    uav: [f32; UAV_FEATURES],
    /// Yields in steps of [`schema::YIELD_STEP_UNITS`], the resolution of the token builder.
    local_map: Vec<i16>,
    devices: Vec<DeviceFeatures>,
}

fn step_units() -> f32 {
    f32::from(schema::YIELD_STEP_UNITS)
}

struct Normalisations {
    uav: [Normalisation; UAV_FEATURES],
    device: [Normalisation; DEVICE_FEATURES],
    yields: Normalisation,
}

static NORMALISATIONS: LazyLock<Normalisations> = LazyLock::new(|| {
    let of = |tensor: &str| schema::normalisations(tensor).collect::<Vec<_>>();
    let matches = "the widths are those of the schema";
    Normalisations {
        uav: of("uav").try_into().expect(matches),
        device: of("devices").try_into().expect(matches),
        yields: of("local_map")[0],
    }
});

fn apply<const N: usize>(physical: &[f32; N], scales: &[Normalisation; N]) -> [f32; N] {
    std::array::from_fn(|index| scales[index].apply(physical[index]))
}

impl Observation {
    /// Normalises tokens and drops their preference.
    #[must_use]
    pub fn new(tokens: &Tokens) -> Observation {
        let scales = &*NORMALISATIONS;
        Observation {
            uav: apply(&tokens.uav, &scales.uav),
            devices: tokens.devices.iter().map(|device| apply(device, &scales.device)).collect(),
            local_map: tokens.local_map.iter().map(|&units| (units / step_units()) as i16).collect(),
        }
    }

    /// Moves to the terminal: battery minus spare battery.
    #[must_use]
    pub fn distance_to_terminal(&self) -> f32 {
        distance_to_terminal(&self.uav)
    }

    /// The network's input for this state under a preference.
    #[must_use]
    pub fn with(&self, preference: Preference) -> Sample {
        let mut sample = Sample {
            uav: self.uav,
            preference: weights(preference),
            device_count: self.devices.len() as u8,
            ..Sample::default()
        };
        let yields = NORMALISATIONS.yields;
        debug_assert_eq!(self.local_map.len(), LOCAL_MAP_CELLS);
        for (normal, &steps) in sample.local_map.iter_mut().zip(&self.local_map) {
            *normal = yields.apply(f32::from(steps) * step_units());
        }
        sample.devices[..self.devices.len()].copy_from_slice(&self.devices);
        sample
    }
}

/// Moves to the terminal, from the normalised features of the aircraft: spare battery, battery, ...
pub(crate) fn distance_to_terminal(&[spare, battery, ..]: &[f32; UAV_FEATURES]) -> f32 {
    (battery - spare) * schema::BATTERY.scale
}

/// The network's input for these tokens.
#[must_use]
pub fn normalise(tokens: &Tokens) -> Sample {
    let mut sample = Observation::new(tokens).with(Preference::ENERGY);
    sample.preference = tokens.preference;
    sample
}

/// The network's input for the current state of a flight.
#[must_use]
pub fn sample(flight: &Flight) -> Sample {
    normalise(&flight.tokens())
}

/// The encoding of the shipped policy.
#[derive(Clone, Copy, Debug)]
pub struct PolicyTokens;

impl Encoding for PolicyTokens {
    type Observation = Observation;
    type Network = Shape;
    const MOSAC_NAME: &'static str = "gleaner";

    fn of(_: &City) -> PolicyTokens {
        PolicyTokens
    }

    fn observe(&self, flight: &Flight) -> Observation {
        Observation::new(&flight.tokens())
    }

    fn push(&self, state: &Observation, preferences: &[Preference], batch: &mut Batch) {
        let mut sample = state.with(Preference::ENERGY);
        for &preference in preferences {
            sample.preference = weights(preference);
            batch.push_sample(&sample);
        }
    }

    fn distance_to_terminal(state: &Observation) -> f32 {
        state.distance_to_terminal()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_policy::{ChannelOffset, DeviceState, Situation, View};
    use gleaner_units::{Action, BatteryUnits, Cell, Db};
    use gleaner_world::Mirror;

    #[test]
    fn view_equals_observation_in_mirrored_city() {
        let city = City::default_city();
        let grid = city.grid();
        let open = city.open_cells();
        for mirror in Mirror::ALL {
            let mirrored = city.mirrored(mirror);
            let view = View::ALL.into_iter().find(|view| {
                Action::ALL.into_iter().all(|action| view.action(action) == mirror.action(action))
            });
            let observed = |city: &City, mirror: Mirror, uav: Cell| {
                let situation = Situation {
                    cell: mirror.cell(grid, uav),
                    battery: BatteryUnits(60.0),
                    spare: BatteryUnits(20.0),
                    terminal: mirror.cell(grid, Cell::new(30, 18)),
                    preference: Preference::DATA,
                    sight: city,
                    channel: ChannelOffset::NONE,
                };
                let devices = (0..6_u8).map(|index| DeviceState {
                    cell: mirror.cell(grid, open[usize::from(index) * 101]),
                    remaining: 1000.0 * f32::from(index),
                    snr: Some(Db(f32::from(index))),
                });
                normalise(&Tokens::build(&situation, devices).0)
            };
            for uav in [Cell::new(3, 4), Cell::new(20, 15), Cell::new(38, 22)] {
                let plain = observed(&city, Mirror::default(), uav);
                assert!(plain.local_map.iter().any(|&units| units > 0.0), "no yield around {uav}");
                assert_eq!(observed(&mirrored, mirror, uav), plain.seen(view.unwrap()), "{mirror:?} {uav}");
            }
        }
    }
}
