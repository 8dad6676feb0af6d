//! Trainings that were repeated with several seeds: mean and standard deviation over the runs.

use crate::judge::interval::{mean, sample_variance};
use crate::keep::curves::Point;
use gleaner_world::ScenarioKind;
use std::collections::BTreeMap;

/// The metrics that are reported, by their names in a learning curve.
pub(super) const REPORTED: [&str; 3] = ["coverage_percent", "least_energy", "mean_hypervolume"];

/// The learning curves of one training with several seeds. A run may be of one scenario only.
#[derive(Clone, Debug, PartialEq)]
pub struct Training {
    /// Name in tables and legends.
    pub name: String,
    /// Folder and learning curve of each run.
    pub runs: Vec<(String, Vec<Point>)>,
}

/// A metric over the runs of a training, after the same number of environment steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OverSeeds {
    /// Environment steps.
    pub steps: u64,
    /// Number of runs.
    pub seeds: usize,
    /// The mean.
    pub mean: f64,
    /// Sample standard deviation; 0 for one run.
    pub deviation: f64,
}

impl Training {
    /// A metric along the training, where all runs of the scenario have it.
    pub(super) fn along(&self, kind: ScenarioKind, metric: &str) -> Vec<OverSeeds> {
        let key = format!("{}/{metric}", kind.name());
        let mut values: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
        let mut seeds = 0;
        for (_, points) in &self.runs {
            let found = points.iter().filter_map(|point| Some((point.steps()?, *point.scalars.get(&key)?)));
            let mut is_of_scenario = false;
            for (steps, value) in found {
                values.entry(steps).or_default().push(value);
                is_of_scenario = true;
            }
            seeds += usize::from(is_of_scenario);
        }
        values.retain(|_, values| values.len() == seeds);
        values.into_iter().map(|(steps, values)| OverSeeds::of(steps, &values)).collect()
    }
}

impl OverSeeds {
    fn of(steps: u64, values: &[f64]) -> OverSeeds {
        let deviation = sample_variance(values).sqrt();
        OverSeeds { steps, seeds: values.len(), mean: mean(values), deviation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(kind: &str, values: &[(u64, f64)]) -> (String, Vec<Point>) {
        let point = |&(steps, value): &(u64, f64)| Point {
            update: steps / 4,
            unix_s: 0.0,
            scalars: [("steps".to_owned(), steps as f64), (format!("{kind}/coverage_percent"), value)].into(),
        };
        (kind.to_owned(), values.iter().map(point).collect())
    }

    #[test]
    fn mean_and_deviation_are_over_the_runs_of_one_scenario_at_common_steps() {
        let training = Training {
            name: "t".into(),
            runs: vec![
                run("rd", &[(100, 70.0), (200, 80.0), (300, 99.0)]),
                run("rd", &[(100, 74.0), (200, 80.0)]),
                run("rb", &[(100, 10.0)]),
            ],
        };
        let along = training.along(ScenarioKind::ReachDestination, "coverage_percent");
        let steps: Vec<_> = along.iter().map(|point| (point.steps, point.seeds, point.mean)).collect();
        assert_eq!(steps, [(100, 2, 72.0), (200, 2, 80.0)], "step 300 was reached by one seed only");
        assert!((along[0].deviation - 8.0_f64.sqrt()).abs() < 1e-12 && along[1].deviation == 0.0);
        let alone = training.along(ScenarioKind::ReturnBase, "coverage_percent");
        assert_eq!((alone.len(), alone[0].seeds, alone[0].deviation), (1, 1, 0.0));
        assert!(training.along(ScenarioKind::ReturnBase, "least_energy").is_empty());
    }
}
