//! The worlds that a policy is refined in: the default city, and others that it will never meet again.

use crate::learn::settings::Settings;
use crate::planner::Rates;
use gleaner_units::Db;
use gleaner_world::{Channel, City, Fading, Seed, Stream, World};
use rand::RngExt;
use std::sync::Arc;

/// Generated cities. Evaluations count theirs from 0, these are far from them.
const CITIES_FROM: u64 = 1_000_000;
const CITIES: u64 = 200;
/// How far the noise may be off, dB.
const NOISE_OFF_DB: f32 = 2.0;
/// Share of the reports that do not arrive, in the missions over generated cities.
const REPORTS_MISSING: f64 = 0.1;

/// The worlds.
pub struct Variety {
    usual: (Arc<World>, Rates),
    others: Vec<(Arc<World>, Rates)>,
    share: f64,
}

/// Where a mission is flown, and how well it is heard.
pub struct Setting<'a> {
    /// The city and its channel.
    pub world: &'a Arc<World>,
    /// What the planner knows of the channel.
    pub rates: &'a Rates,
    /// Share of the reports that do not arrive.
    pub reports_missing: f64,
}

impl Variety {
    /// Builds the worlds that the settings ask for.
    #[must_use]
    pub fn new(usual: &Arc<World>, settings: &Settings) -> Variety {
        let count = if settings.share_cities > 0.0 { CITIES } else { 0 };
        let with_rates = |world: Arc<World>| (Arc::clone(&world), Rates::new(world));
        let others = (CITIES_FROM..CITIES_FROM + count).map(|number| with_rates(Arc::new(other(number))));
        Variety {
            usual: with_rates(Arc::clone(usual)),
            others: others.collect(),
            share: settings.share_cities,
        }
    }

    /// Where the mission with this number is flown.
    #[must_use]
    pub fn setting(&self, mission: u64) -> Setting<'_> {
        let mut rng = Seed::training(mission).repeat(u32::MAX).rng(Stream::Choices);
        let elsewhere = !self.others.is_empty() && rng.random_bool(self.share);
        let ((world, rates), reports_missing) = if elsewhere {
            (&self.others[rng.random_range(0..self.others.len())], REPORTS_MISSING)
        } else {
            (&self.usual, 0.0)
        };
        Setting { world, rates, reports_missing }
    }
}

fn other(number: u64) -> World {
    let mut rng = Seed::training(number).rng(Stream::Choices);
    let usual = Channel::default();
    let channel = Channel {
        noise: usual.noise + Db(rng.random_range(-NOISE_OFF_DB..=NOISE_OFF_DB)),
        fading: if rng.random() { Fading::Rayleigh } else { Fading::None },
        ..usual
    };
    World::new(City::generate(number), channel)
}
