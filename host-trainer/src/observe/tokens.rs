//! From the tokens that fly to the numbers that the network's first layer sees.

use crate::net::{DeviceFeatures, Sample};
use gleaner_policy::schema::{self, Normalisation};
use gleaner_policy::{LOCAL_MAP_CELLS, Preference, Tokens};
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// What the replay memory keeps of a state: everything but the preference, small enough to keep 100,000 of
/// them. Normalised, except for the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    uav: [f32; 4],
    /// Yields in steps of [`schema::YIELD_STEP_UNITS`], as the builder makes them.
    local_map: Vec<i16>,
    devices: Vec<DeviceFeatures>,
}

fn step_units() -> f32 {
    f32::from(schema::YIELD_STEP_UNITS)
}

struct Normalisations {
    uav: [Normalisation; 4],
    device: [Normalisation; 7],
    yields: Normalisation,
}

static NORMALISATIONS: LazyLock<Normalisations> = LazyLock::new(|| {
    let of = |tensor: &str| schema::normalisations(tensor).collect::<Vec<_>>();
    let matches = "the schema has 4 numbers for the aircraft and 7 for a device";
    Normalisations {
        uav: of("uav").try_into().expect(matches),
        device: of("devices").try_into().expect(matches),
        yields: of("local_map")[0],
    }
});

impl Observation {
    /// Normalises tokens and forgets their preference.
    #[must_use]
    pub fn new(tokens: &Tokens) -> Observation {
        let scales = &*NORMALISATIONS;
        let apply = |(physical, scale): (&f32, &Normalisation)| scale.apply(*physical);
        let mut uav = [0.0; 4];
        for (normal, pair) in uav.iter_mut().zip(tokens.uav.iter().zip(&scales.uav)) {
            *normal = apply(pair);
        }
        let devices = tokens
            .devices
            .iter()
            .map(|device| {
                let mut normal = [0.0; 7];
                for (normal, pair) in normal.iter_mut().zip(device.iter().zip(&scales.device)) {
                    *normal = apply(pair);
                }
                normal
            })
            .collect();
        let local_map = tokens.local_map.iter().map(|&units| (units / step_units()) as i16).collect();
        Observation { uav, local_map, devices }
    }

    /// Moves to the terminal: battery minus spare battery.
    #[must_use]
    pub fn way_to_terminal(&self) -> f32 {
        way_to_terminal(self.uav[0], self.uav[1])
    }

    /// The network's input for this state under a preference.
    #[must_use]
    pub fn with(&self, preference: Preference) -> Sample {
        let mut sample = Sample {
            uav: self.uav,
            preference: [preference.w_data(), preference.w_energy()],
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

/// Moves to the terminal, from the normalised spare battery and battery.
pub(crate) fn way_to_terminal(spare: f32, battery: f32) -> f32 {
    (battery - spare) * schema::BATTERY.scale
}

/// The network's input for these tokens.
#[must_use]
pub fn normalise(tokens: &Tokens) -> Sample {
    let mut sample = Observation::new(tokens).with(Preference::ENERGY);
    sample.preference = tokens.preference;
    sample
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_policy::{DeviceState, Situation, View};
    use gleaner_units::{Action, BatteryUnits, Cell, Db};
    use gleaner_world::{City, Mirror};

    /// What the builder makes of a mirrored city is the view of what it makes of the city.
    #[test]
    fn a_view_is_what_would_be_seen_in_the_mirrored_city() {
        let city = City::default_city();
        let grid = city.grid();
        let open = city.open_cells();
        for mirror in Mirror::ALL {
            let mirrored = city.mirrored(mirror);
            let view = View::ALL.into_iter().find(|view| {
                Action::ALL.into_iter().all(|action| view.action(action) == mirror.action(action))
            });
            let seen = |city: &City, mirror: Mirror, uav: Cell| {
                let situation = Situation {
                    cell: mirror.cell(grid, uav),
                    battery: BatteryUnits(60.0),
                    spare: BatteryUnits(20.0),
                    terminal: mirror.cell(grid, Cell::new(30, 18)),
                    preference: Preference::DATA,
                    sight: city,
                };
                let devices = (0..6_u8).map(|index| DeviceState {
                    cell: mirror.cell(grid, open[usize::from(index) * 101]),
                    remaining: 1000.0 * f32::from(index),
                    snr: Some(Db(f32::from(index))),
                });
                normalise(&Tokens::build(&situation, devices).0)
            };
            for uav in [Cell::new(3, 4), Cell::new(20, 15), Cell::new(38, 22)] {
                let plain = seen(&city, Mirror::default(), uav);
                assert!(plain.local_map.iter().any(|&units| units > 0.0), "{uav} hears somebody");
                assert_eq!(seen(&mirrored, mirror, uav), plain.seen(view.unwrap()), "{mirror:?} {uav}");
            }
        }
    }
}
