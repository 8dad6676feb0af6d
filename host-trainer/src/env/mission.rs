//! The distribution of the missions that a trainer flies.

use crate::env::greedy::Greedy;
use crate::env::site::Site;
use gleaner_policy::Preference;
use gleaner_units::{BatteryUnits, Cell};
use gleaner_world::{Realization, Scenario, ScenarioError, ScenarioKind, Seed, Stream, World};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Longest distance between a random start and a random terminal, moves. Opposite corners of the default city are 68
/// moves apart, and the smallest battery holds 50 units.
const WAY_MAX: u32 = 45;
/// Number of devices of a varied mission, K.
const VARIED_DEVICES: std::ops::RangeInclusive<usize> = 1..=12;
/// Battery of a varied mission, units, B.
const VARIED_BATTERY: std::ops::RangeInclusive<i32> = 50..=120;

/// Shares of the kinds of mission, each in `0..=1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionShares {
    /// Missions with the zones of RD.
    pub rd: f64,
    /// Missions with the zone of RB. The rest starts and ends anywhere.
    pub rb: f64,
    /// Missions with another number of devices and another battery.
    pub varied: f64,
    /// Missions flown by GREEDY.
    pub greedy: f64,
    /// Missions under (1, 0) or (0, 1). The other preferences are uniform.
    pub pure_preferences: f64,
}

/// A mission to train on.
#[derive(Clone, Debug)]
pub struct Mission {
    /// The seed of its random draws.
    pub seed: Seed,
    /// Zones, battery and devices.
    pub realization: Realization,
    /// The preference that it is flown under.
    pub preference: Preference,
    /// The heuristic that flies it in place of the policy, if any.
    pub guide: Option<Greedy>,
}

/// An endless sequence of missions: equal seeds and shares give equal missions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionSource {
    /// The run's seed. Runs with different seeds share no mission among the first 2^32.
    pub seed: u64,
    /// What kinds of mission it draws.
    pub shares: MissionShares,
}

impl MissionSource {
    /// The mission with this number at `site`.
    ///
    /// # Errors
    /// The city has no room for it.
    pub fn mission(&self, site: &Site, number: u64) -> Result<Mission, ScenarioError> {
        let world = site.world();
        let seed = Seed::training((self.seed << 32).wrapping_add(number));
        let mut rng = seed.rng(Stream::Choices);
        let mut scenario = self.scenario(site, &mut rng);
        if rng.random_bool(self.shares.varied) {
            let battery = BatteryUnits(rng.random_range(VARIED_BATTERY) as f32);
            scenario = scenario.with_devices(rng.random_range(VARIED_DEVICES)).with_battery(battery);
        }
        let preference = if rng.random_bool(self.shares.pure_preferences) {
            if rng.random_bool(0.5) { Preference::DATA } else { Preference::ENERGY }
        } else {
            random_preference(&mut rng)
        };
        let guide = rng
            .random_bool(self.shares.greedy)
            .then(|| Greedy::new(rng.random_range(1..=scenario.device_count.max(1))));
        let realization = match site.devices() {
            None => Realization::draw(world.city(), &scenario, seed)?,
            Some(devices) => Realization::new(world.city(), &scenario, devices.to_vec())?,
        };
        Ok(Mission { seed, realization, preference, guide })
    }

    fn scenario(&self, site: &Site, rng: &mut ChaCha8Rng) -> Scenario {
        let choice: f64 = rng.random();
        if choice < self.shares.rd {
            return site.scenario(ScenarioKind::ReachDestination);
        }
        let base = site.scenario(ScenarioKind::ReturnBase);
        if choice < self.shares.rd + self.shares.rb {
            return base;
        }
        random_zones(site.world(), base, rng)
    }
}

/// `base` with a random start and a random terminal, at most [`WAY_MAX`] moves apart.
fn random_zones(world: &World, base: Scenario, rng: &mut ChaCha8Rng) -> Scenario {
    let open = world.city().open_cells();
    let mut cell = || -> Cell { open[rng.random_range(0..open.len())] };
    loop {
        let scenario = Scenario { start: cell(), terminal: cell(), ..base };
        if scenario.shortest_moves() <= WAY_MAX {
            return scenario;
        }
    }
}

/// A preference with `w_data` uniform in `0..1`.
pub fn random_preference(rng: &mut ChaCha8Rng) -> Preference {
    Preference::new(rng.random::<f32>()).unwrap_or(Preference::DATA)
}
