//! The paper's metrics: fixed realizations, eleven preferences, fronts and hypervolumes.

use crate::flight::{Flight, Reward};
use crate::greedy::Greedy;
use crate::net::{self, Batch, Sample, Shape, Workspace};
use crate::observation::normalise;
use crate::pareto::{REFERENCE, hypervolume};
use gleaner_policy::{Policy, Preference};
use gleaner_units::Action;
use gleaner_world::{Realization, Scenario, ScenarioError, Seed, World};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The paper's test preferences: `(i / 10, 1 - i / 10)`.
#[must_use]
pub fn test_preferences() -> Vec<Preference> {
    (0..=10).filter_map(|i| Preference::new(i as f32 / 10.0)).collect()
}

/// What decides in an evaluation: many flights at once, so that an engine may work in batches.
pub trait Decider {
    /// One action for each flight, inside its mask.
    ///
    /// # Errors
    /// The engine's own.
    fn decide(&mut self, flights: &[&Flight]) -> Result<Vec<Action>, DeciderError>;
}

/// An engine gave no answer.
#[derive(Debug, thiserror::Error)]
#[error("the model gave no decision: {0}")]
pub struct DeciderError(pub String);

/// The learner's own network, in batches.
pub struct Network<'a> {
    shape: Shape,
    parameters: &'a [f32],
    batch: Batch,
    workspace: Workspace,
}

impl<'a> Network<'a> {
    /// The actor with these parameters.
    #[must_use]
    pub fn new(shape: Shape, parameters: &'a [f32]) -> Network<'a> {
        Network { shape, parameters, batch: Batch::new(), workspace: Workspace::new() }
    }

    /// The logits for these inputs.
    pub fn logits(&mut self, samples: impl IntoIterator<Item = Sample>) -> Vec<[f32; Action::COUNT]> {
        self.batch.clear();
        for sample in samples {
            self.batch.push_sample(&sample);
        }
        let outputs = net::forward(&self.shape, self.parameters, &self.batch, &mut self.workspace);
        outputs.as_chunks().0.to_vec()
    }
}

impl Decider for Network<'_> {
    fn decide(&mut self, flights: &[&Flight]) -> Result<Vec<Action>, DeciderError> {
        let logits = self.logits(flights.iter().map(|flight| normalise(&flight.tokens())));
        flights
            .iter()
            .zip(&logits)
            .map(|(flight, logits)| {
                flight
                    .mask()
                    .argmax(logits)
                    .ok_or_else(|| DeciderError("the network's answer is not a number".into()))
            })
            .collect()
    }
}

/// An engine that flies, one decision at a time.
pub struct Engine<'a, P>(pub &'a mut P);

impl<P: Policy<Error: std::fmt::Display>> Decider for Engine<'_, P> {
    fn decide(&mut self, flights: &[&Flight]) -> Result<Vec<Action>, DeciderError> {
        flights
            .iter()
            .map(|flight| {
                let answer =
                    self.0.infer(&flight.tokens()).map_err(|error| DeciderError(error.to_string()))?;
                flight
                    .mask()
                    .argmax(&answer.logits)
                    .ok_or_else(|| DeciderError("the engine's answer is not a number".into()))
            })
            .collect()
    }
}

/// Mean and spread of one preference over the realizations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Weight of data.
    pub w_data: f32,
    /// Mean percent of the data.
    pub data_percent: f32,
    /// Mean battery units used.
    pub energy: f32,
    /// Standard deviation of the battery units used.
    pub energy_std: f32,
}

impl Row {
    fn new(w_data: f32, totals: &[Reward]) -> Row {
        let count = totals.len() as f32;
        let mean = |objective: usize| totals.iter().map(|total| total[objective]).sum::<f32>() / count;
        let energy = -mean(1);
        let variance =
            totals.iter().map(|total| (-total[1] - energy) * (-total[1] - energy)).sum::<f32>() / count;
        Row { w_data, data_percent: mean(0), energy, energy_std: variance.max(0.0).sqrt() }
    }

    /// As a point of the front.
    #[must_use]
    pub const fn point(&self) -> Reward {
        [self.data_percent, -self.energy]
    }
}

/// One evaluated system in one scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// One row a preference, by rising weight of data.
    pub rows: Vec<Row>,
    /// Hypervolume of the mean front above the paper's reference point.
    pub hypervolume: f64,
    /// Mean over preferences of `w . J` (paper, average utility).
    pub utility: f32,
}

impl Table {
    fn new(rows: Vec<Row>) -> Table {
        let points: Vec<Reward> = rows.iter().map(Row::point).collect();
        let utility = rows
            .iter()
            .map(|row| row.w_data * row.data_percent - (1.0 - row.w_data) * row.energy)
            .sum::<f32>()
            / rows.len() as f32;
        Table { hypervolume: hypervolume(&points, REFERENCE), utility, rows }
    }

    /// Percent of the data at w = (1, 0).
    #[must_use]
    pub fn coverage(&self) -> f32 {
        self.rows.last().map_or(0.0, |row| row.data_percent)
    }

    /// Battery units used at w = (0, 1).
    #[must_use]
    pub fn least_energy(&self) -> f32 {
        self.rows.first().map_or(0.0, |row| row.energy)
    }
}

/// The evaluation realizations `0..count` of a scenario.
///
/// # Errors
/// The scenario does not fit the city.
pub fn realizations(
    world: &World,
    scenario: &Scenario,
    count: u64,
) -> Result<Vec<(Seed, Realization)>, ScenarioError> {
    (0..count)
        .map(|number| {
            let seed = Seed::evaluation(number);
            Realization::draw(world.city(), scenario, seed).map(|realization| (seed, realization))
        })
        .collect()
}

/// Flies every realization under every test preference.
///
/// # Errors
/// The decider failed.
///
/// # Panics
/// When the realizations belong to another world.
pub fn evaluate(
    world: &Arc<World>,
    realizations: &[(Seed, Realization)],
    decider: &mut dyn Decider,
) -> Result<Table, DeciderError> {
    let preferences = test_preferences();
    let mut flights: Vec<Flight> = preferences
        .iter()
        .flat_map(|&preference| {
            realizations.iter().map(move |(seed, realization)| {
                Flight::new(world, realization, *seed, preference).expect("drawn for this world")
            })
        })
        .collect();
    loop {
        let mut active: Vec<&mut Flight> = flights.iter_mut().filter(|flight| !flight.is_over()).collect();
        if active.is_empty() {
            break;
        }
        let actions = decider.decide(&active.iter().map(|flight| &**flight).collect::<Vec<_>>())?;
        for (flight, action) in active.iter_mut().zip(actions) {
            flight.step(action);
        }
    }
    let rows = preferences
        .iter()
        .zip(flights.chunks(realizations.len()))
        .map(|(preference, flights)| {
            Row::new(preference.w_data(), &flights.iter().map(Flight::total).collect::<Vec<_>>())
        })
        .collect();
    Ok(Table::new(rows))
}

/// GREEDY on the same realizations: for each preference the number of visits with the best mean utility, as the
/// paper lets its parameterisation be chosen.
///
/// # Panics
/// When the realizations belong to another world.
#[must_use]
pub fn evaluate_greedy(world: &Arc<World>, realizations: &[(Seed, Realization)]) -> Table {
    let most_devices = realizations.iter().map(|(_, r)| r.devices().len()).max().unwrap_or(0);
    let per_visits: Vec<Vec<Reward>> = (0..=most_devices)
        .map(|visits| {
            realizations
                .iter()
                .map(|(seed, realization)| {
                    let mut flight = Flight::new(world, realization, *seed, Preference::DATA)
                        .expect("drawn for this world");
                    let mut greedy = Greedy::new(visits);
                    while !flight.is_over() {
                        flight.step(greedy.decide(&flight));
                    }
                    flight.total()
                })
                .collect()
        })
        .collect();
    let rows = test_preferences()
        .iter()
        .map(|preference| {
            per_visits
                .iter()
                .map(|totals| Row::new(preference.w_data(), totals))
                .max_by(|a, b| {
                    let utility = |row: &Row| {
                        preference.w_data() * row.data_percent - preference.w_energy() * row.energy
                    };
                    utility(a).total_cmp(&utility(b))
                })
                .expect("at least the parameterisation without visits")
        })
        .collect();
    Table::new(rows)
}
