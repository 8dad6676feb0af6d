//! The paper's test settings, and all numbers in its text and its table.
//!
//! Most of its results are figures without printed numbers. No number here is read off a figure.

use crate::judge::evaluation::test_preferences;
use gleaner_units::BatteryUnits;
use gleaner_world::{Scenario, ScenarioKind};
use serde::{Deserialize, Serialize};

/// One test setting (paper, section V-D): scenario, number of devices, battery at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Setting {
    /// RD or RB.
    pub kind: ScenarioKind,
    /// K.
    pub devices: usize,
    /// B, battery units.
    pub battery: u16,
}

impl Setting {
    /// The paper's, RD first.
    pub const ALL: [Setting; 10] = {
        let mut all = [Setting { kind: ScenarioKind::ReachDestination, devices: 0, battery: 0 }; 10];
        let mut index = 0;
        while index < 10 {
            let (devices, battery) = [(3, 80), (5, 80), (6, 80), (9, 80), (10, 100)][index % 5];
            all[index] = Setting { kind: ScenarioKind::ALL[index / 5], devices, battery };
            index += 1;
        }
        all
    };

    /// The trained setting: K = 6, B = 80.
    #[must_use]
    pub const fn trained(kind: ScenarioKind) -> Setting {
        Setting { kind, devices: 6, battery: 80 }
    }

    /// As a scenario of the world.
    #[must_use]
    pub fn scenario(self) -> Scenario {
        self.kind.scenario().with_devices(self.devices).with_battery(BatteryUnits(f32::from(self.battery)))
    }

    /// `RD` or `RB`.
    #[must_use]
    pub const fn scenario_name(self) -> &'static str {
        match self.kind {
            ScenarioKind::ReachDestination => "RD",
            ScenarioKind::ReturnBase => "RB",
        }
    }

    /// Battery units of the shortest mission: no mission uses less.
    #[must_use]
    pub fn least_energy(self) -> f32 {
        self.scenario().shortest_moves() as f32
    }

    /// The paper's printed numbers for this setting.
    #[must_use]
    pub fn published(self) -> Published {
        use ScenarioKind::{ReachDestination as Rd, ReturnBase as Rb};
        let coverage = match (self.kind, self.devices) {
            (Rd, 3) => Some("nearly all"),
            (Rd, 6) => Some("about 87"),
            (Rb, 6) => Some("about 85"),
            (_, 10) => Some("about 80"),
            _ => None,
        };
        let least_energy = match self.kind {
            Rd => "32",
            Rb => "2",
        };
        Published { coverage, least_energy }
    }
}

/// Printed numbers of one setting, MOSAC-ATT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Published {
    /// Percent of the data at w = (1, 0): section V-C for K = 6, V-D for the others.
    pub coverage: Option<&'static str>,
    /// Battery units at w = (0, 1): sections V-C and V-D, in every realization, without deviation.
    pub least_energy: &'static str,
}

/// A printed number and its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Citation {
    /// The measurement.
    pub what: &'static str,
    /// As printed, with its unit.
    pub value: &'static str,
    /// Section, table or figure of the paper.
    pub place: &'static str,
}

const fn cite(what: &'static str, value: &'static str, place: &'static str) -> Citation {
    Citation { what, value, place }
}

/// All printed numbers of the paper's results.
pub const CITATIONS: [Citation; 25] = [
    cite("coverage at w = (1, 0), RD, K = 6, B = 80, MOSAC-ATT", "approximately 87 %", "section V-C"),
    cite("coverage at w = (1, 0), RB, K = 6, B = 80, MOSAC-ATT", "approximately 85 %", "section V-C"),
    cite("coverage at w = (1, 0), RD, K = 3, B = 80, MOSAC-ATT", "nearly all available data", "section V-D"),
    cite("coverage at w = (1, 0), RD and RB, K = 10, B = 100, MOSAC-ATT", "around 80 %", "section V-D"),
    cite("coverage at w = (1, 0), K = 10, B = 100, MOSAC-CGL", "72 %", "section V-D"),
    cite("battery at w = (0, 1), RD, all settings, MOSAC-ATT", "32 units", "sections V-C and V-D"),
    cite("battery at w = (0, 1), RB, all settings, MOSAC-ATT", "2 units", "sections V-C and V-D"),
    cite("data collected, regular channel: mean", "87.49 %", "table I"),
    cite("data collected, regular channel: standard deviation", "0.16", "table I"),
    cite("data collected, Rayleigh fading: mean", "87.23 %", "table I"),
    cite("data collected, Rayleigh fading: standard deviation", "0.28", "table I"),
    cite("example mission, RD, w = (1, 0)", "77 %, 78.5 units", "figure 5 a"),
    cite("example mission, RD, w = (0.5, 0.5)", "68 %, 48 units", "figure 5 b"),
    cite("example mission, RD, w = (0, 1)", "25 %, 32 units", "figure 5 c"),
    cite("example mission, RB, w = (1, 0)", "84 %, 78.5 units", "figure 5 d"),
    cite("example mission, RB, w = (0.5, 0.5)", "79 %, 59 units", "figure 5 e"),
    cite("example mission, RB, w = (0, 1)", "2 %, 2 units", "figure 5 f"),
    cite("parameters, MOSAC-ATT", "91,781", "section V-C"),
    cite("parameters, MOSAC-CGL", "165,829", "section V-C"),
    cite("mean inference time, MOSAC-ATT, Xeon Gold 6278C, 4 cores", "2.0 ms", "section V-C"),
    cite("mean inference time, MOSAC-CGL, Xeon Gold 6278C, 4 cores", "1.3 ms", "section V-C"),
    cite("steps until MOSAC-ATT leads in hypervolume, all seeds", "approximately 150,000", "section V-C"),
    cite("training steps per seed", "1.5 million, 3 seeds", "section V-A"),
    cite("evaluations per system and setting", "1,100", "section V-B"),
    cite("reference point of the hypervolume", "(-1, -200)", "section V-B"),
];

/// The example missions of figure 5: scenario, weight of data, percent of the data, battery units.
pub const EXAMPLES: [(ScenarioKind, f32, f32, f32); 6] = [
    (ScenarioKind::ReachDestination, 1.0, 77.0, 78.5),
    (ScenarioKind::ReachDestination, 0.5, 68.0, 48.0),
    (ScenarioKind::ReachDestination, 0.0, 25.0, 32.0),
    (ScenarioKind::ReturnBase, 1.0, 84.0, 78.5),
    (ScenarioKind::ReturnBase, 0.5, 79.0, 59.0),
    (ScenarioKind::ReturnBase, 0.0, 2.0, 2.0),
];

/// Bounds on the results of any system in one setting, as means over its missions: data from above, energy from below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Percent of the data.
    pub data_percent: f32,
    /// Battery units.
    pub least_energy: f32,
}

impl Bounds {
    /// Upper bound of the hypervolume of the mean front: the rectangle of the best data and the least energy.
    #[must_use]
    pub fn hypervolume(self) -> f64 {
        crate::judge::pareto::hypervolume(
            &[[self.data_percent, -self.least_energy]],
            crate::judge::pareto::REFERENCE,
        )
    }

    /// Upper bound of the average utility.
    #[must_use]
    pub fn utility(self) -> f32 {
        let preferences = test_preferences();
        let of = |p: &gleaner_policy::Preference| {
            p.w_data() * self.data_percent - p.w_energy() * self.least_energy
        };
        preferences.iter().map(of).sum::<f32>() / preferences.len() as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_are_the_papers() {
        let names: Vec<String> = Setting::ALL
            .iter()
            .map(|s| format!("{} {} {}", s.scenario_name(), s.devices, s.battery))
            .collect();
        assert_eq!(names[..5], ["RD 3 80", "RD 5 80", "RD 6 80", "RD 9 80", "RD 10 100"]);
        assert_eq!(names[5..], ["RB 3 80", "RB 5 80", "RB 6 80", "RB 9 80", "RB 10 100"]);
        assert_eq!(Setting::ALL.map(Setting::least_energy), [32., 32., 32., 32., 32., 2., 2., 2., 2., 2.]);
        assert!(Setting::ALL.contains(&Setting::trained(ScenarioKind::ReturnBase)));
    }

    #[test]
    fn limits_hold_for_the_best_that_can_be() {
        let limits = Bounds { data_percent: 100.0, least_energy: 32.0 };
        assert_eq!(limits.hypervolume(), 101.0 * 168.0);
        assert!((limits.utility() - (50.0 - 16.0)).abs() < 1e-4);
    }
}
