//! Domain randomisation: the default city, generated cities, and the default city in a world that differs from what the
//! aircraft assumes.

use crate::env::flight::SharedTable;
use crate::env::mismatch::Mismatch;
use crate::env::site::Site;
use gleaner_units::Db;
use gleaner_world::{Channel, City, Fading, Seed, Stream, World};
use rand::RngExt;
use std::sync::Arc;

/// Number of the first generated city. Evaluations count theirs from 0.
const CITIES_FROM: u64 = 1_000_000;
/// Generated cities.
const CITIES: u64 = 200;
/// Seeds of the worlds that differ begin here.
const MISMATCHES_FROM: u64 = 2_000_000;
/// Worlds that differ.
const MISMATCHES: u64 = 48;
/// Largest error of the noise level in generated cities, dB.
const NOISE_ERROR_DB: f32 = 2.0;
/// Share of the reports that are lost in generated cities.
const REPORTS_MISSING: f64 = 0.1;

/// The settings of a run's missions.
pub struct Variety {
    /// The run's own city.
    own: Setting,
    generated: Vec<Setting>,
    differing: Vec<Setting>,
    share_cities: f64,
    share_mismatched: f64,
}

/// Where a mission is flown, and what the aircraft knows of it.
pub struct Setting {
    /// The site.
    pub site: Site,
    /// How the world differs from what the aircraft assumes. The channel is that of the site.
    pub mismatch: Mismatch,
    /// The map on board, where it differs from the city.
    pub map: Option<Arc<City>>,
    /// The table of the city; none where the map on board is another one, and none in generated cities, since the tables of
    /// all would fill the memory.
    pub table: Option<SharedTable>,
}

impl Variety {
    /// `site` alone, or with generated cities and worlds that differ if their shares of the missions are above 0.
    #[must_use]
    pub fn new(site: &Site, share_cities: f64, share_mismatched: f64) -> Variety {
        let count = |share: f64, all: u64| if share > 0.0 { all } else { 0 };
        let cities = CITIES_FROM..CITIES_FROM + count(share_cities, CITIES);
        let mismatches = MISMATCHES_FROM..MISMATCHES_FROM + count(share_mismatched, MISMATCHES);
        Variety {
            own: Setting {
                site: site.clone(),
                mismatch: Mismatch::default(),
                map: None,
                table: Some(site.table().clone()),
            },
            generated: cities.map(generate).collect(),
            differing: mismatches.map(|number| differ(site, number)).collect(),
            share_cities,
            share_mismatched,
        }
    }

    /// All settings; the first is the run's own city.
    pub fn settings(&self) -> impl Iterator<Item = &Setting> {
        std::iter::once(&self.own).chain(&self.generated).chain(&self.differing)
    }

    /// Where the mission with this number is flown, and its position in [`Variety::settings`].
    #[must_use]
    pub fn setting(&self, mission: u64) -> (usize, &Setting) {
        let mut rng = Seed::training(mission).repeat(u32::MAX).rng(Stream::Choices);
        if !self.generated.is_empty() && rng.random_bool(self.share_cities) {
            let index = rng.random_range(0..self.generated.len());
            (1 + index, &self.generated[index])
        } else if !self.differing.is_empty() && rng.random_bool(self.share_mismatched) {
            let index = rng.random_range(0..self.differing.len());
            (1 + self.generated.len() + index, &self.differing[index])
        } else {
            (0, &self.own)
        }
    }
}

fn generate(number: u64) -> Setting {
    let mut rng = Seed::training(number).rng(Stream::Choices);
    let nominal = Channel::default();
    let channel = Channel {
        noise: nominal.noise + Db(rng.random_range(-NOISE_ERROR_DB..=NOISE_ERROR_DB)),
        fading: if rng.random() { Fading::Rayleigh } else { Fading::None },
        ..nominal
    };
    Setting {
        site: Site::new(Arc::new(World::new(City::generate(number), channel))),
        mismatch: Mismatch { missing_reports: REPORTS_MISSING, ..Mismatch::default() },
        map: None,
        table: None,
    }
}

fn differ(site: &Site, number: u64) -> Setting {
    let seed = Seed::training(number);
    let city = site.world().city();
    let mismatch = Mismatch::draw(&mut seed.rng(Stream::Choices));
    let map = mismatch.map(city, seed.repeat(1));
    let table = map.is_none().then(|| site.table().clone());
    Setting { site: site.in_world(Arc::new(mismatch.world(city.clone()))), mismatch, map, table }
}
