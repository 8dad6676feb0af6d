//! `--city` and `--mission`: one's own city instead of the default one.

use anyhow::{Context, Result, bail};
use gleaner_host_trainer::env::site::{MissionPlan, Site};
use gleaner_host_trainer::settings::Settings;
use gleaner_pilot::{Mission, mission_file};
use gleaner_world::{Channel, City, Placement, Realization, Scenario, World};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Where the missions take place.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct SiteArguments {
    /// Fly over this city instead of the default one: building heights in metres, CSV, one row per line from north to
    /// south, cells of 20 m. Start and terminal move to the nearest open cells.
    #[arg(long, value_name = "FILE", conflicts_with = "mission")]
    pub city: Option<PathBuf>,
    /// Fly this mission file, as `gleaner` flies it: its city, terminal, battery and devices. RB starts at the terminal,
    /// RD as far from it as half of the battery reaches.
    #[arg(long, value_name = "FILE")]
    pub mission: Option<PathBuf>,
}

impl SiteArguments {
    /// Whether missions take place in the default city.
    pub const fn is_default(&self) -> bool {
        self.city.is_none() && self.mission.is_none()
    }

    /// The site, under the default channel.
    pub fn site(&self) -> Result<Site> {
        match (&self.city, &self.mission) {
            (None, None) => Ok(Site::default_site()),
            (Some(path), _) => Ok(Site::new(world(read_city(path)?))),
            (None, Some(path)) => read_mission(path),
        }
    }

    /// The site of a training run, and its fingerprint in the settings, so that a run is not continued elsewhere.
    pub fn open(&self, settings: &mut Settings) -> Result<Site> {
        let site = self.site()?;
        settings.site = (!self.is_default()).then(|| fingerprint(&site));
        Ok(site)
    }
}

/// Hash of city and devices.
pub fn fingerprint(site: &Site) -> String {
    let city = format!("{:016x}", site.world().city().fingerprint());
    match site.devices() {
        None => city,
        Some(devices) => {
            let devices = gleaner_host_trainer::keep::parts::fingerprint(format!("{devices:?}").as_bytes());
            format!("{city}-{devices}")
        }
    }
}

fn world(city: City) -> Arc<World> {
    Arc::new(World::new(city, Channel::default()))
}

fn read_city(path: &Path) -> Result<City> {
    let text = fs::read_to_string(path).with_context(|| format!("--city {}", path.display()))?;
    let text = text.trim_start_matches('\u{feff}');
    City::from_csv(text).with_context(|| format!("--city {}", path.display()))
}

fn read_mission(path: &Path) -> Result<Site> {
    let place = || format!("--mission {}", path.display());
    let text = fs::read_to_string(path).with_context(place)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let city_text = |name: &str| fs::read_to_string(folder.join(name)).map_err(|error| error.to_string());
    let mission = mission_file::read(&text, city_text).with_context(place)?;
    site_of(&mission).with_context(place)
}

fn site_of(mission: &Mission) -> Result<Site> {
    let city = City::new(mission.heights.clone())?;
    if mission.fence != gleaner_units::CellSet::full(city.grid()) {
        eprintln!("note: the fence of the mission is not simulated; training may fly over all cells");
    }
    if mission.devices.is_empty() {
        bail!("no devices; add at least one [[device]]");
    }
    let devices: Vec<Placement> = (mission.devices.iter())
        .map(|device| Placement { cell: device.cell, data_units: device.data })
        .collect();
    let plan = MissionPlan { terminal: mission.terminal, battery: mission.budget, devices };
    let base = Scenario {
        start: plan.terminal,
        terminal: plan.terminal,
        battery: plan.battery,
        device_count: plan.devices.len(),
    };
    Realization::new(&city, &base, plan.devices.clone())?;
    Ok(Site::new(world(city)).with_plan(plan))
}
