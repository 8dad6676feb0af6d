//! The paper's tables and figures from our own measurements: what is shown, the CSV files and the page.
//!
//! Measuring is not done here; [`Report`] holds what was measured, and everything here is a pure function of it.

mod attention;
mod chart;
mod csv;
mod drawing;
mod figure;
mod page;
mod section;
mod table;

pub use csv::files;
pub use page::page;

pub use crate::planner::oracle::OracleSetting;

use crate::judge::evaluation::{Missions, Table};
use crate::judge::explanation::{Gaze, Track};
use crate::judge::paper::{Limits, Setting};
use crate::judge::robustness::Repeats;
use crate::keep::curves::Point;
use gleaner_units::HeightMap;
use gleaner_world::ScenarioKind;
use serde::{Deserialize, Serialize};

/// Everything that the report shows.
#[derive(Clone, Debug)]
pub struct Report {
    /// The command that makes the report again.
    pub command: String,
    /// What the inference times were measured on.
    pub machine: String,
    /// Evaluation realizations per setting.
    pub realizations: u64,
    /// The city that was flown in.
    pub heights: HeightMap,
    /// Its fingerprint.
    pub city_hash: u64,
    /// GREEDY first, then the learned systems in the order in which they were given.
    pub systems: Vec<System>,
    /// What the oracle reached and what the bound allows, by setting; missing settings were not computed.
    pub oracle: Vec<OracleSetting>,
    /// A closer look at the first learned system.
    pub detail: Option<Detail>,
    /// Learning curves by the name of their run.
    pub curves: Vec<(String, Vec<Point>)>,
}

/// One system, flown in all settings.
#[derive(Clone, Debug)]
pub struct System {
    /// How it is called in tables and legends.
    pub name: String,
    /// What it was read from and what flew it.
    pub origin: String,
    /// Parameters of the policy that decides.
    pub parameters: Option<usize>,
    /// Time of one decision.
    pub latency: Option<Latency>,
    /// In the order of [`Setting::ALL`].
    pub missions: Vec<Missions>,
}

impl System {
    /// Its metrics in one setting.
    #[must_use]
    pub fn table(&self, setting: Setting) -> Option<Table> {
        let index = Setting::ALL.iter().position(|&other| other == setting)?;
        self.missions.get(index).map(Missions::table)
    }
}

/// Time of one decision, one observation at a time on one thread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Latency {
    /// Median, microseconds.
    pub median_us: f32,
    /// 99th percentile, microseconds.
    pub p99_us: f32,
    /// How many decisions were timed.
    pub decisions: u32,
}

impl OracleSetting {
    /// Whether it belongs to this setting.
    #[must_use]
    pub fn is_of(&self, setting: Setting) -> bool {
        self.scenario == setting.kind.name()
            && self.devices == setting.devices
            && self.battery == setting.battery
    }

    /// The limits in the mean over the realizations that were bounded; `None` when none was.
    #[must_use]
    pub fn limits(&self, setting: Setting) -> Option<Limits> {
        let bounds = &self.upper_bound_percent;
        let mean = bounds.iter().map(|bound| bound.min(100.0)).sum::<f32>() / bounds.len().max(1) as f32;
        (!bounds.is_empty()).then(|| Limits { data_percent: mean, least_energy: setting.least_energy() })
    }
}

/// What is only measured of one system.
#[derive(Clone, Debug)]
pub struct Detail {
    /// The system's name.
    pub system: String,
    /// Scenario, without and with Rayleigh fading.
    pub fading: Vec<(ScenarioKind, Repeats, Repeats)>,
    /// RD at w = (1, 0) and at w = (0, 1); empty for a system without attention.
    pub gazes: Vec<Gaze>,
    /// The example's missions at w = 1, 0.5 and 0.
    pub tracks: Vec<(ScenarioKind, Vec<Track>)>,
    /// Number of the evaluation realization that is the example.
    pub example: u64,
}

impl Report {
    /// The oracle in one setting.
    #[must_use]
    pub fn oracle(&self, setting: Setting) -> Option<&OracleSetting> {
        // A later line of the file replaces an earlier one.
        self.oracle.iter().rev().find(|oracle| oracle.is_of(setting))
    }

    /// Whether anything was proven of what is possible.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        self.oracle.iter().any(|oracle| !oracle.upper_bound_percent.is_empty())
    }

    /// Whether the oracle flew the same realizations as the systems: means over others do not compare.
    #[must_use]
    pub fn compares(&self, setting: Setting) -> bool {
        self.oracle(setting).is_some_and(|oracle| oracle.missions.realizations() as u64 == self.realizations)
    }

    /// The proven limits in one setting; `None` unless exactly the realizations of the systems were bounded.
    #[must_use]
    pub fn limits(&self, setting: Setting) -> Option<Limits> {
        let oracle = self.oracle(setting)?;
        let is_whole = oracle.upper_bound_percent.len() as u64 == self.realizations;
        is_whole.then(|| oracle.limits(setting)).flatten()
    }
}
