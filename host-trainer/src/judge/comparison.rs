//! The policy with and without look-ahead beside GREEDY and the oracle, in a world that differs from what the aircraft
//! assumes. All at w = (1, 0), where the differences are largest.

use crate::env::flight::Flight;
use crate::env::mismatch::{MapError, Mismatch};
use crate::judge::evaluation::{Decider, DeciderError, fly_all, fly_all_as, fly_greedy};
use crate::judge::interval::Interval;
use crate::judge::lookahead::LookingAhead;
use crate::judge::paper::Setting;
use gleaner_lookahead::Budget;
use gleaner_policy::{Policy, Preference};
use gleaner_world::{City, Fading, Realization, ScenarioError, Seed, World};
use serde::Serialize;
use std::fmt::{self, Display};
use std::sync::Arc;
use std::time::Duration;

/// A row of the table: how the world differs.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Its name on the command line and in the table.
    pub name: &'static str,
    /// The options of `evaluate` that make the same world.
    pub options: &'static str,
    /// The difference.
    pub mismatch: Mismatch,
}

const NONE: Mismatch = Mismatch {
    noise_db: 0.0,
    exponent: 0.0,
    fading: Fading::None,
    map: MapError::None,
    missing_reports: 0.0,
};

/// All rows, the nominal world first.
pub const ROWS: [Row; 10] = [
    Row { name: "nominal", options: "", mismatch: NONE },
    Row { name: "noise+3", options: "--noise 3", mismatch: Mismatch { noise_db: 3.0, ..NONE } },
    Row { name: "noise+6", options: "--noise 6", mismatch: Mismatch { noise_db: 6.0, ..NONE } },
    Row { name: "noise-6", options: "--noise -6", mismatch: Mismatch { noise_db: -6.0, ..NONE } },
    Row { name: "exponents+0.3", options: "--exponent 0.3", mismatch: Mismatch { exponent: 0.3, ..NONE } },
    Row { name: "fading", options: "--fading", mismatch: Mismatch { fading: Fading::Rayleigh, ..NONE } },
    Row {
        name: "reports-10%",
        options: "--missing-reports 0.1",
        mismatch: Mismatch { missing_reports: 0.1, ..NONE },
    },
    Row {
        name: "buildings-10%",
        options: "--map-error missing=0.1",
        mismatch: Mismatch { map: MapError::Missing(0.1), ..NONE },
    },
    Row {
        name: "heights-10m",
        options: "--map-error heights=10",
        mismatch: Mismatch { map: MapError::Heights(10), ..NONE },
    },
    Row { name: "no-map", options: "--no-map", mismatch: Mismatch { map: MapError::Flat, ..NONE } },
];

/// Percent of the data by mission, one vector per system, all over the same missions.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Compared {
    /// The row's name.
    pub row: String,
    /// `rd` or `rb`.
    pub scenario: String,
    /// Number of devices.
    pub devices: usize,
    /// Battery units at the start.
    pub battery: u16,
    /// The network alone.
    pub network: Vec<f32>,
    /// The network with look-ahead.
    pub lookahead: Vec<f32>,
    /// GREEDY with its best number of visits.
    pub greedy: Vec<f32>,
    /// The planner that knows the true world; empty when it was not run.
    pub oracle: Vec<f32>,
}

/// The missions of one row in the default city.
pub struct Arena {
    row: Row,
    setting: Setting,
    /// The world that is flown in.
    pub world: Arc<World>,
    /// The missions.
    pub drawn: Vec<(Seed, Realization)>,
    map: Option<Arc<City>>,
}

impl Arena {
    /// Missions 0 to `count` - 1 of a setting.
    ///
    /// # Errors
    /// The scenario does not fit the city.
    pub fn new(row: Row, setting: Setting, count: u64) -> Result<Arena, ScenarioError> {
        let world = Arc::new(row.mismatch.world(City::default_city()));
        let seeds = (0..count).map(Seed::evaluation);
        let drawn = seeds.map(|seed| {
            Realization::draw(world.city(), &setting.scenario(), seed).map(|realization| (seed, realization))
        });
        let drawn = drawn.collect::<Result<_, _>>()?;
        let map = row.mismatch.map(world.city(), Seed::evaluation(0));
        Ok(Arena { row, setting, world, drawn, map })
    }

    /// Flies all systems but the oracle. Also gives the times of the network and of the look-ahead, one per decision.
    ///
    /// # Errors
    /// The policy failed.
    pub fn compare<P>(
        &self,
        policy: &mut P,
        budget: Budget,
    ) -> Result<(Compared, [Vec<Duration>; 2]), DeciderError>
    where
        P: Policy<Error: Display>,
    {
        let has_map = self.row.mismatch.map != MapError::Flat;
        // As it flies with look-ahead switched off: its tokens follow the estimated channel.
        let network = self.fly(&mut LookingAhead::new(&mut *policy, Budget::NONE).with_map(has_map))?;
        let mut looking = LookingAhead::new(policy, budget).with_map(has_map);
        let lookahead = self.fly(&mut looking)?;
        let compared = Compared {
            row: self.row.name.to_owned(),
            scenario: self.setting.kind.name().to_owned(),
            devices: self.setting.devices,
            battery: self.setting.battery,
            network,
            lookahead,
            greedy: data(fly_greedy(&self.world, &self.drawn).0.last()),
            oracle: Vec::new(),
        };
        Ok((compared, looking.into_times()))
    }

    /// Energy of each mission at w = (0, 1), battery units: the network's, and with look-ahead.
    ///
    /// # Errors
    /// The policy failed.
    pub fn energy<P>(&self, policy: &mut P, budget: Budget) -> Result<[Vec<f32>; 2], DeciderError>
    where
        P: Policy<Error: Display>,
    {
        let fly = |decider: &mut dyn Decider| {
            let missions = fly_all(&self.world, &self.drawn, &[Preference::ENERGY], decider)?;
            Ok(missions.0.last().into_iter().flatten().map(|total| -total[1]).collect())
        };
        let network = fly(&mut LookingAhead::new(&mut *policy, Budget::NONE))?;
        Ok([network, fly(&mut LookingAhead::new(policy, budget))?])
    }

    /// The least energy of each mission, battery units: the way to the terminal; out and back where the mission starts
    /// there, because it ends with a move into the terminal's cell.
    #[must_use]
    pub fn least_energy(&self) -> Vec<f32> {
        let least = |(_, realization): &(Seed, Realization)| match realization
            .start()
            .manhattan(realization.terminal())
        {
            0 => 2.0,
            moves => moves as f32,
        };
        self.drawn.iter().map(least).collect()
    }

    fn fly(&self, decider: &mut dyn Decider) -> Result<Vec<f32>, DeciderError> {
        let prepare = |flight: Flight, seed| self.row.mismatch.prepare(flight, self.map.as_ref(), seed);
        let missions = fly_all_as(&self.world, &self.drawn, &[Preference::DATA], decider, prepare)?;
        Ok(data(missions.0.last()))
    }
}

/// The data of each mission, percent.
fn data(totals: Option<&Vec<[f32; 2]>>) -> Vec<f32> {
    totals.into_iter().flatten().map(|total| total[0]).collect()
}

/// One row as Markdown.
impl Display for Compared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Compared { row, scenario, devices, battery, network, lookahead, greedy, oracle } = self;
        let scenario = scenario.to_uppercase();
        write!(f, "| {row} | {scenario} | {devices} | {battery} | {} ", Interval::of(network))?;
        write!(f, "| {} | {} ", Interval::of(lookahead), Interval::of_difference(lookahead, network))?;
        write!(f, "| {} ", Interval::of(greedy))?;
        if oracle.is_empty() {
            return write!(f, "| - | - |");
        }
        write!(f, "| {} | {} |", Interval::of(oracle), Interval::of_share(lookahead, oracle))
    }
}

/// The heading of the rows.
pub const HEADING: &str = "| world | scenario | K | B | network | look-ahead | look-ahead - network | GREEDY | oracle \
                           | look-ahead / oracle, % |\n|---|---|---|---|---|---|---|---|---|---|";

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_policy::{Attention, Inference, Tokens};
    use gleaner_world::ScenarioKind;

    /// A network that hovers where that is allowed.
    struct Hover;

    impl Policy for Hover {
        type Error = String;

        fn infer(&mut self, _: &Tokens) -> Result<Inference, String> {
            Ok(Inference { logits: [1.0, 0.0, 0.0, 0.0, 0.0], attention: Attention::NONE })
        }
    }

    #[test]
    fn lookahead_lifts_a_bad_network_and_needs_a_map() {
        let row = |name| *ROWS.iter().find(|row: &&Row| row.name == name).unwrap();
        let fly = |name| {
            let setting = Setting::trained(ScenarioKind::ReturnBase);
            Arena::new(row(name), setting, 2).unwrap().compare(&mut Hover, Budget { tours: 60 }).unwrap().0
        };
        let nominal = fly("nominal");
        assert!(
            Interval::of(&nominal.lookahead).mean > Interval::of(&nominal.network).mean + 20.0,
            "{nominal}"
        );
        let blind = fly("no-map");
        assert_eq!(blind.lookahead, blind.network, "without a map the network decides alone");
    }

    #[test]
    fn a_row_shows_the_paired_difference() {
        let compared = Compared {
            row: "nominal".into(),
            scenario: "rd".into(),
            network: vec![80.0, 90.0],
            lookahead: vec![85.0, 95.0],
            greedy: vec![70.0, 70.0],
            ..Compared::default()
        };
        let text = compared.to_string();
        assert!(text.contains("| 5.0 ± 0.0 |") && text.ends_with("| 70.0 ± 0.0 | - | - |"), "{text}");
    }
}
