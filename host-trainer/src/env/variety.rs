//! Domain randomisation: the default city, and generated cities with another channel.

use crate::env::site::Site;
use gleaner_units::Db;
use gleaner_world::{Channel, City, Fading, Seed, Stream, World};
use rand::RngExt;
use std::sync::Arc;

/// Number of the first generated city. Evaluations count theirs from 0.
const CITIES_FROM: u64 = 1_000_000;
/// Generated cities.
const CITIES: u64 = 200;
/// Largest error of the noise level in generated cities, dB.
const NOISE_ERROR_DB: f32 = 2.0;
/// Share of the reports that are lost in generated cities.
const REPORTS_MISSING: f64 = 0.1;

/// The sites of a run.
pub struct Variety {
    /// The run's own site, then the generated ones.
    sites: Vec<Site>,
    share: f64,
}

/// Where a mission is flown.
pub struct Setting<'a> {
    /// Position of the site in [`Variety::sites`].
    pub index: usize,
    /// The site.
    pub site: &'a Site,
    /// Share of the reports that are lost.
    pub reports_missing: f64,
}

impl Variety {
    /// `site` alone, or with generated cities if their share of the missions is above 0.
    #[must_use]
    pub fn new(site: &Site, share_cities: f64) -> Variety {
        let count = if share_cities > 0.0 { CITIES } else { 0 };
        let generated =
            (CITIES_FROM..CITIES_FROM + count).map(|number| Site::new(Arc::new(generate(number))));
        Variety { sites: std::iter::once(site.clone()).chain(generated).collect(), share: share_cities }
    }

    /// All sites; the first is the run's own.
    #[must_use]
    pub fn sites(&self) -> &[Site] {
        &self.sites
    }

    /// Where the mission with this number is flown.
    #[must_use]
    pub fn setting(&self, mission: u64) -> Setting<'_> {
        let mut rng = Seed::training(mission).repeat(u32::MAX).rng(Stream::Choices);
        let generated = self.sites.len() - 1;
        let (index, reports_missing) = if generated > 0 && rng.random_bool(self.share) {
            (1 + rng.random_range(0..generated), REPORTS_MISSING)
        } else {
            (0, 0.0)
        };
        Setting { index, site: &self.sites[index], reports_missing }
    }
}

fn generate(number: u64) -> World {
    let mut rng = Seed::training(number).rng(Stream::Choices);
    let nominal = Channel::default();
    let channel = Channel {
        noise: nominal.noise + Db(rng.random_range(-NOISE_ERROR_DB..=NOISE_ERROR_DB)),
        fading: if rng.random() { Fading::Rayleigh } else { Fading::None },
        ..nominal
    };
    World::new(City::generate(number), channel)
}
