//! The paper's robustness test: the same realizations with Rayleigh fading on every link, flown many times.

use crate::judge::evaluation::{Decider, DeciderError, fly_all, mean_and_std};
use gleaner_policy::Preference;
use gleaner_world::{Channel, City, Fading, Realization, Seed, World};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Percent of the data at w = (1, 0), the mean over the realizations, once per repeat.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Repeats(pub Vec<f32>);

impl Repeats {
    /// Mean over the repeats and standard deviation among them (paper, table I).
    #[must_use]
    pub fn mean_and_std(&self) -> (f32, f32) {
        mean_and_std(self.0.iter().copied())
    }
}

/// A city under the default channel, with or without fading. Policies are trained without.
#[must_use]
pub fn world_with(city: City, fading: Fading) -> Arc<World> {
    Arc::new(World::new(city, Channel { fading, ..Channel::default() }))
}

/// Flies every realization `repeats` times at w = (1, 0), each time with other draws of shadowing and fading. Repeat 0
/// draws what the evaluation draws.
///
/// # Errors
/// The decider failed.
///
/// # Panics
/// When the realizations belong to another city.
pub fn repeat_flights(
    world: &Arc<World>,
    realizations: &[(Seed, Realization)],
    repeats: u32,
    decider: &mut dyn Decider,
) -> Result<Repeats, DeciderError> {
    let once = |repeat: u32| {
        let again: Vec<(Seed, Realization)> =
            realizations.iter().map(|(seed, drawn)| (seed.repeat(repeat), drawn.clone())).collect();
        let missions = fly_all(world, &again, &[Preference::DATA], decider)?;
        Ok(mean_and_std(missions.0.iter().flatten().map(|total| total[0])).0)
    };
    (0..repeats).map(once).collect::<Result<_, _>>().map(Repeats)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::flight::Flight;
    use crate::env::greedy::Greedy;
    use crate::judge::evaluation::realizations;
    use gleaner_units::Action;
    use gleaner_world::Scenario;

    /// GREEDY with one device to visit needs no memory from slot to slot before the device is empty, which suffices to
    /// distinguish channels.
    struct FirstDevice;

    impl Decider for FirstDevice {
        fn decide(&mut self, flights: &[&Flight]) -> Result<Vec<Action>, DeciderError> {
            Ok(flights.iter().map(|flight| Greedy::new(1).decide(flight)).collect())
        }
    }

    #[test]
    fn repeats_differ_fading_differs_and_equal_calls_are_equal() {
        let fly = |fading| {
            let world = world_with(City::default_city(), fading);
            let drawn = realizations(&world, &Scenario::reach_destination(), 4).unwrap();
            repeat_flights(&world, &drawn, 3, &mut FirstDevice).unwrap()
        };
        let regular = fly(Fading::None);
        assert_eq!(regular, fly(Fading::None));
        assert_ne!(regular, fly(Fading::Rayleigh));
        assert!(regular.0[0] != regular.0[1] && regular.0[1] != regular.0[2], "{regular:?}");
        let (mean, std) = regular.mean_and_std();
        assert!(mean > 10.0 && std < mean, "{mean} {std}");
    }
}
