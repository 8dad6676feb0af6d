//! The realizations that choose the best parameters of a run.

use crate::env::site::Site;
use crate::judge::evaluation::{Decider, DeciderError, Network, Table, evaluate};
use crate::net::Shape;
use crate::settings::Settings;
use gleaner_world::{Realization, ScenarioError, ScenarioKind, Seed, World};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Realizations that choose the best parameters have numbers from here on; those that judge count from 0.
const VALIDATION_FROM: u64 = 10_000;
const VALIDATION_COUNT: u64 = 60;
/// The evaluation realizations (paper, section V-A: 100 fixed ones).
const EVALUATION_COUNT: u64 = 100;
/// Price of a wasted battery unit, in hypervolume.
const WASTE_PRICE: f64 = 100.0;

/// Per scenario that is trained: name and validation table.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Tables(pub Vec<(String, Table)>);

impl Tables {
    /// The score that selects the best parameters: the mean hypervolume over the scenarios, less `WASTE_PRICE` for each
    /// battery unit wasted at w = (0, 1). Such units change the hypervolume little, but a mission for energy alone must be
    /// the shortest one.
    #[must_use]
    pub fn score(&self) -> f64 {
        let hypervolumes: f64 = self.0.iter().map(|(_, table)| table.hypervolume).sum();
        hypervolumes / self.0.len().max(1) as f64 - WASTE_PRICE * f64::from(self.wasted_energy())
    }

    /// Battery units used at w = (0, 1) beyond the shortest mission, summed over the scenarios.
    #[must_use]
    fn wasted_energy(&self) -> f32 {
        let wasted = |(name, table): &(String, Table)| {
            let shortest = name.parse::<ScenarioKind>().map_or(0, |kind| kind.scenario().shortest_moves());
            table.least_energy() - shortest as f32
        };
        self.0.iter().map(wasted).sum()
    }
}

/// The realizations that choose the best parameters: other ones than those that are trained on and those that judge.
#[derive(Clone, Debug)]
pub struct Validation(Vec<(ScenarioKind, Vec<(Seed, Realization)>)>);

impl Validation {
    /// Those of the scenarios that the settings train.
    ///
    /// # Errors
    /// The scenario does not fit the city.
    pub fn draw(site: &Site, settings: &Settings) -> Result<Validation, ScenarioError> {
        let shares = [settings.share_rd, settings.share_rb];
        let trained = ScenarioKind::ALL.into_iter().zip(shares).filter(|(_, share)| *share > 0.0);
        trained
            .map(|(kind, _)| {
                let numbers = if settings.validate_on_evaluation {
                    0..EVALUATION_COUNT
                } else {
                    VALIDATION_FROM..VALIDATION_FROM + VALIDATION_COUNT
                };
                let drawn = numbers.map(|number| {
                    let seed = Seed::evaluation(number);
                    Ok((seed, site.realization(&site.scenario(kind), seed)?))
                });
                Ok((kind, drawn.collect::<Result<_, ScenarioError>>()?))
            })
            .collect::<Result<_, _>>()
            .map(Validation)
    }

    /// The paper's metrics of a decider on them.
    ///
    /// # Errors
    /// The decider failed.
    pub fn tables(&self, world: &Arc<World>, decider: &mut dyn Decider) -> Result<Tables, DeciderError> {
        let mut table = |(kind, realizations): &(ScenarioKind, Vec<(Seed, Realization)>)| {
            Ok((kind.name().to_owned(), evaluate(world, realizations, decider)?))
        };
        self.0.iter().map(&mut table).collect::<Result<_, _>>().map(Tables)
    }

    /// The paper's metrics of a MOSAC-ATT actor on them.
    ///
    /// # Errors
    /// The network's answer is not a number: the run diverged.
    pub fn judge(&self, world: &Arc<World>, actor: &[f32]) -> Result<Tables, DeciderError> {
        self.tables(world, &mut Network::new(Shape::actor(), actor))
    }
}
