//! The paper's tables and figures with our measurements, as a page and as CSV files.
//!
//! [`Report`] holds the measurements; this module measures nothing and is a pure function of it.

mod attention;
mod chart;
mod csv;
mod drawing;
mod figure;
mod page;
mod section;
mod seeds;
mod table;
mod training;

pub use csv::files;
pub use page::page;
pub use training::Training;

pub use crate::planner::oracle::OracleSetting;

use crate::judge::evaluation::{Missions, Table};
use crate::judge::explanation::{Gaze, Track};
use crate::judge::paper::{Bounds, Setting};
use crate::judge::robustness::Repeats;
use crate::keep::curves::Point;
use gleaner_units::HeightMap;
use gleaner_world::ScenarioKind;
use serde::{Deserialize, Serialize};

/// The content of the report.
#[derive(Clone, Debug)]
pub struct Report {
    /// The command that repeats the report.
    pub command: String,
    /// The machine of the inference times.
    pub machine: String,
    /// Evaluation realizations per setting.
    pub realizations: u64,
    /// Number of the evaluation realization of the example figures.
    pub example: u64,
    /// The city of the missions.
    pub heights: HeightMap,
    /// Its fingerprint.
    pub city_hash: u64,
    /// GREEDY first, then the learned systems in the given order.
    pub systems: Vec<System>,
    /// Results of the oracle and the bound, by setting. Settings that were not computed are missing.
    pub oracle: Vec<OracleSetting>,
    /// Details of the first learned system and of every other one with attention.
    pub details: Vec<Detail>,
    /// Learning curves of the systems, by the name of the run.
    pub curves: Vec<(String, Vec<Point>)>,
    /// Trainings that were repeated with several seeds.
    pub trainings: Vec<Training>,
}

/// One system, flown in all settings.
#[derive(Clone, Debug)]
pub struct System {
    /// Name in tables and legends.
    pub name: String,
    /// Its file and the engine that ran it.
    pub origin: String,
    /// Parameters of the policy.
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
    /// Number of timed decisions.
    pub decisions: u32,
}

impl OracleSetting {
    /// Whether it is for this setting.
    #[must_use]
    pub fn is_of(&self, setting: Setting) -> bool {
        self.scenario == setting.kind.name()
            && self.devices == setting.devices
            && self.battery == setting.battery
    }

    /// The bound as a mean over the bounded realizations; `None` without any.
    #[must_use]
    pub fn limits(&self, setting: Setting) -> Option<Bounds> {
        let bounds = &self.upper_bound_percent;
        let mean = bounds.iter().map(|bound| bound.min(100.0)).sum::<f32>() / bounds.len().max(1) as f32;
        (!bounds.is_empty()).then(|| Bounds { data_percent: mean, least_energy: setting.least_energy() })
    }
}

/// Measurements that only some systems get.
#[derive(Clone, Debug)]
pub struct Detail {
    /// The system's name.
    pub system: String,
    /// Scenario, without and with Rayleigh fading.
    pub fading: Vec<(ScenarioKind, Repeats, Repeats)>,
    /// RD at w = (1, 0) and at w = (0, 1); empty for a system without attention.
    pub gazes: Vec<Gaze>,
    /// The missions of the example at w = 1, 0.5 and 0.
    pub tracks: Vec<(ScenarioKind, Vec<Track>)>,
}

impl Detail {
    /// Whether the system has attention.
    #[must_use]
    pub fn has_attention(&self) -> bool {
        !self.gazes.is_empty()
    }
}

impl Report {
    /// The oracle in one setting.
    #[must_use]
    pub fn oracle(&self, setting: Setting) -> Option<&OracleSetting> {
        // A later line of the file replaces an earlier one.
        self.oracle.iter().rev().find(|oracle| oracle.is_of(setting))
    }

    /// Whether a bound was computed.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        self.oracle.iter().any(|oracle| !oracle.upper_bound_percent.is_empty())
    }

    /// Whether the oracle has the same realizations as the systems. Means over others are not comparable.
    #[must_use]
    pub fn compares(&self, setting: Setting) -> bool {
        self.oracle(setting).is_some_and(|oracle| oracle.missions.realizations() as u64 == self.realizations)
    }

    /// The bound in one setting; `None` unless it covers exactly the realizations of the systems.
    #[must_use]
    pub fn limits(&self, setting: Setting) -> Option<Bounds> {
        let oracle = self.oracle(setting)?;
        let is_whole = oracle.upper_bound_percent.len() as u64 == self.realizations;
        is_whole.then(|| oracle.limits(setting)).flatten()
    }
}
