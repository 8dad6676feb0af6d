//! The paper's metrics: fixed realizations, eleven preferences, fronts and hypervolumes.

use crate::env::flight::{Flight, Reward, SharedTable};
use crate::env::greedy::Greedy;
use crate::judge::pareto::{REFERENCE, hypervolume};
use crate::net::{self, Batch, Sample, Shape, Workspace};
use crate::observe::tokens::normalise;
use gleaner_policy::{Attention, Policy, Preference, View};
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

    /// Like [`Decider::decide`]; the numbers identify the flights from slot to slot, for a decider with a memory.
    ///
    /// # Errors
    /// The engine's own.
    fn decide_numbered(&mut self, flights: &[(usize, &Flight)]) -> Result<Vec<Action>, DeciderError> {
        self.decide(&flights.iter().map(|(_, flight)| *flight).collect::<Vec<_>>())
    }

    /// Attention of the second layer for the next decision of this flight; `None` for a system without attention.
    ///
    /// # Errors
    /// The engine's own.
    fn attention(&mut self, _flight: &Flight) -> Result<Option<Attention>, DeciderError> {
        Ok(None)
    }
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
        let outputs = net::answer(&self.shape, self.parameters, &self.batch, &mut self.workspace);
        outputs.as_chunks().0.to_vec()
    }

    /// The mean logits over the eight views of these inputs.
    pub fn averaged_logits(&mut self, samples: &[Sample]) -> Vec<[f32; Action::COUNT]> {
        let mut sums = vec![[0.0; Action::COUNT]; samples.len()];
        for view in View::ALL {
            let logits = self.logits(samples.iter().map(|sample| sample.seen(view)));
            for (sum, logits) in sums.iter_mut().zip(logits) {
                for action in Action::ALL {
                    sum[action.index()] += logits[view.action(action).index()] / View::ALL.len() as f32;
                }
            }
        }
        sums
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

    fn attention(&mut self, flight: &Flight) -> Result<Option<Attention>, DeciderError> {
        self.batch.clear();
        self.batch.push_sample(&normalise(&flight.tokens()));
        net::forward(&self.shape, self.parameters, &self.batch, &mut self.workspace);
        Ok(Some(Attention(self.workspace.attention(0))))
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

    fn attention(&mut self, flight: &Flight) -> Result<Option<Attention>, DeciderError> {
        let answer = self.0.infer(&flight.tokens()).map_err(|error| DeciderError(error.to_string()))?;
        Ok(Some(answer.attention))
    }
}

/// Mean and spread of one preference over the realizations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Weight of data.
    pub w_data: f32,
    /// Mean percent of the data.
    pub data_percent: f32,
    /// Standard deviation of the percent of the data.
    #[serde(default)]
    pub data_std: f32,
    /// Mean battery units used.
    pub energy: f32,
    /// Standard deviation of the battery units used.
    pub energy_std: f32,
}

impl Row {
    fn new(w_data: f32, totals: &[Reward]) -> Row {
        let (data_percent, data_std) = mean_and_std(totals.iter().map(|total| total[0]));
        let (energy, energy_std) = mean_and_std(totals.iter().map(|total| -total[1]));
        Row { w_data, data_percent, data_std, energy, energy_std }
    }

    /// As a point of the front.
    #[must_use]
    pub const fn point(&self) -> Reward {
        [self.data_percent, -self.energy]
    }

    /// `w . J` (paper, average utility).
    #[must_use]
    pub fn utility(&self) -> f32 {
        utility(self.w_data, self.point())
    }
}

fn utility(w_data: f32, total: Reward) -> f32 {
    w_data * total[0] + (1.0 - w_data) * total[1]
}

/// Mean and population standard deviation, the paper's; zeros for no numbers.
#[must_use]
pub fn mean_and_std(numbers: impl Iterator<Item = f32> + Clone) -> (f32, f32) {
    let count = numbers.clone().count().max(1) as f64;
    let mean = numbers.clone().map(f64::from).sum::<f64>() / count;
    let variance = numbers.map(|x| (f64::from(x) - mean) * (f64::from(x) - mean)).sum::<f64>() / count;
    (mean as f32, variance.sqrt() as f32)
}

/// Results of one system in one setting: for each test preference by rising weight of data, the total of each realization
/// in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Missions(pub Vec<Vec<Reward>>);

impl Missions {
    /// The paper's metrics of them.
    #[must_use]
    pub fn table(&self) -> Table {
        let rows: Vec<Row> = test_preferences()
            .iter()
            .zip(&self.0)
            .map(|(preference, totals)| Row::new(preference.w_data(), totals))
            .collect();
        let points: Vec<Reward> = rows.iter().map(Row::point).collect();
        Table {
            hypervolume: hypervolume(&points, REFERENCE),
            mean_hypervolume: self.mean_hypervolume(),
            utility: rows.iter().map(Row::utility).sum::<f32>() / rows.len().max(1) as f32,
            rows,
        }
    }

    /// How many realizations were flown.
    #[must_use]
    pub fn realizations(&self) -> usize {
        self.0.first().map_or(0, Vec::len)
    }

    fn mean_hypervolume(&self) -> f64 {
        let of_one = |realization: usize| {
            let points: Vec<Reward> = self.0.iter().map(|totals| totals[realization]).collect();
            hypervolume(&points, REFERENCE)
        };
        (0..self.realizations()).map(of_one).sum::<f64>() / self.realizations().max(1) as f64
    }
}

/// The paper's metrics of one system in one setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// One row a preference, by rising weight of data.
    pub rows: Vec<Row>,
    /// Hypervolume of the mean front above the paper's reference point.
    pub hypervolume: f64,
    /// Mean over the realizations of the hypervolume of the eleven missions of one realization.
    #[serde(default)]
    pub mean_hypervolume: f64,
    /// Mean over preferences of `w . J` (paper, average utility).
    pub utility: f32,
}

impl Table {
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

    /// Standard deviation of the battery units used at w = (0, 1).
    #[must_use]
    pub fn least_energy_std(&self) -> f32 {
        self.rows.first().map_or(0.0, |row| row.energy_std)
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

/// Flies every realization under each preference.
///
/// # Errors
/// The decider failed.
///
/// # Panics
/// When the realizations belong to another world.
pub fn fly_all(
    world: &Arc<World>,
    realizations: &[(Seed, Realization)],
    preferences: &[Preference],
    decider: &mut dyn Decider,
) -> Result<Missions, DeciderError> {
    fly_all_as(world, realizations, preferences, decider, |flight, _| flight)
}

/// Like [`fly_all`]; `prepare` changes each flight before it starts, for example its map or its reports.
///
/// # Errors
/// The decider failed.
///
/// # Panics
/// When the realizations belong to another world.
pub fn fly_all_as(
    world: &Arc<World>,
    realizations: &[(Seed, Realization)],
    preferences: &[Preference],
    decider: &mut dyn Decider,
    prepare: impl Fn(Flight, Seed) -> Flight,
) -> Result<Missions, DeciderError> {
    let mut flights: Vec<Flight> = Vec::new();
    let table = SharedTable::default();
    for &preference in preferences {
        for (seed, realization) in realizations {
            let flight = Flight::new(world, realization, *seed, preference).expect("drawn for this world");
            flights.push(prepare(flight.with_table(&table), *seed));
        }
    }
    loop {
        let mut active: Vec<(usize, &mut Flight)> =
            flights.iter_mut().enumerate().filter(|(_, flight)| !flight.is_over()).collect();
        if active.is_empty() {
            break;
        }
        let seen: Vec<(usize, &Flight)> =
            active.iter().map(|(number, flight)| (*number, &**flight)).collect();
        let actions = decider.decide_numbered(&seen)?;
        for ((_, flight), action) in active.iter_mut().zip(actions) {
            flight.step(action);
        }
    }
    let totals = |flights: &[Flight]| flights.iter().map(Flight::total).collect();
    Ok(Missions(flights.chunks(realizations.len().max(1)).map(totals).collect()))
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
    Ok(fly_all(world, realizations, &test_preferences(), decider)?.table())
}

/// GREEDY on the same realizations: for each preference the number of visits with the best mean utility, as the
/// paper lets its parameterisation be chosen.
///
/// # Panics
/// When the realizations belong to another world.
#[must_use]
pub fn fly_greedy(world: &Arc<World>, realizations: &[(Seed, Realization)]) -> Missions {
    let most_devices = realizations.iter().map(|(_, r)| r.devices().len()).max().unwrap_or(0);
    let fly = |visits: usize| -> Vec<Reward> {
        realizations
            .iter()
            .map(|(seed, realization)| {
                let mut flight =
                    Flight::new(world, realization, *seed, Preference::DATA).expect("drawn for this world");
                let mut greedy = Greedy::new(visits);
                while !flight.is_over() {
                    flight.step(greedy.decide(&flight));
                }
                flight.total()
            })
            .collect()
    };
    let per_visits: Vec<Vec<Reward>> = (0..=most_devices).map(fly).collect();
    let best = |preference: &Preference| {
        let value = |totals: &Vec<Reward>| Row::new(preference.w_data(), totals).utility();
        let best = per_visits.iter().max_by(|a, b| value(a).total_cmp(&value(b)));
        best.expect("at least the parameterisation without visits").clone()
    };
    Missions(test_preferences().iter().map(best).collect())
}

/// The table of [`fly_greedy`].
///
/// # Panics
/// When the realizations belong to another world.
#[must_use]
pub fn evaluate_greedy(world: &Arc<World>, realizations: &[(Seed, Realization)]) -> Table {
    fly_greedy(world, realizations).table()
}

#[cfg(test)]
mod tests;
