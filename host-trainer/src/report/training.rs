//! Trainings that were repeated with several seeds: mean and standard deviation, along the training and at its end.

use super::Report;
use super::chart::{Axis, Joined, Series, Spot, grouped, legend, look, plot};
use super::section::section;
use super::table::{self, Metric};
use crate::judge::paper::Setting;
use crate::keep::curves::Point;
use gleaner_world::ScenarioKind;
use maud::{Markup, html};
use std::collections::BTreeMap;

/// Name of GREEDY's row.
const GREEDY: &str = "GREEDY";

/// The metrics of the table, and their names in a learning curve.
const METRICS: [(Metric, &str); 3] = [
    (Metric::Coverage, "coverage_percent"),
    (Metric::LeastEnergy, "least_energy"),
    (Metric::MeanHypervolume, "mean_hypervolume"),
];

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
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        OverSeeds { steps, seeds: values.len(), mean, deviation: (squares / (count - 1.0).max(1.0)).sqrt() }
    }
}

/// The section with curves and table; empty without trainings.
pub(super) fn trainings_section(report: &Report) -> Markup {
    if report.trainings.is_empty() {
        return html! {};
    }
    section(
        "seeds",
        "The paper's training, with several seeds (figure 4 a, c)",
        html! {
            figure {
                (trainings_legend(report))
                @for (name, metric) in [("Mean hypervolume", "mean_hypervolume"), ("Data at w = (1, 0), %", "coverage_percent")] {
                    div.panels.two {
                        @for kind in ScenarioKind::ALL {
                            div.panel { h3 { (name) ", " (Setting::trained(kind).scenario_name()) } (chart(report, kind, name, metric)) }
                        }
                    }
                }
                figcaption {
                    b { "Figure 4 a, c. " } "Mean over the seeds, and a band of one standard deviation, on the evaluation "
                    "realizations, as the paper evaluates during training. RD and RB are trained apart. The paper says that "
                    "MOSAC-ATT leads after approximately 150\u{2009}000 steps. From " code { "trainings.csv" } "."
                }
            }
            @for kind in ScenarioKind::ALL { (final_table(report, kind)) }
        },
    )
}

fn trainings_legend(report: &Report) -> Markup {
    let names = report.trainings.iter().enumerate();
    legend(&names.map(|(place, training)| (training.name.clone(), look(place + 1))).collect::<Vec<_>>())
}

fn chart(report: &Report, kind: ScenarioKind, name: &str, metric: &str) -> Markup {
    let of_one = |(place, training): (usize, &Training)| {
        let spots = training.along(kind, metric).into_iter().map(|point| Spot {
            x: point.steps as f64 / 1000.0,
            y: point.mean,
            spread: point.deviation,
            said: format!(
                "{}, {} steps: {:.1} ± {:.1}, {} seeds",
                training.name, point.steps, point.mean, point.deviation, point.seeds
            ),
        });
        Series { look: look(place + 1), spots: spots.collect(), joined: Joined::Band }
    };
    let series: Vec<Series> = report.trainings.iter().enumerate().map(of_one).collect();
    let spots = || series.iter().flat_map(|one| &one.spots);
    if spots().next().is_none() {
        return html! { p.quiet { "None of the trainings was validated in this scenario." } };
    }
    let x = Axis::around("environment steps, thousands", spots().map(|spot| spot.x), [Some(0.0), None]);
    let ends = spots().flat_map(|spot| [spot.y - spot.spread, spot.y + spot.spread]);
    let y = Axis::around(&name.to_lowercase(), ends, [None, None]);
    plot(&format!("{name} along the training, {kind}"), &x, &y, &series, None)
}

fn final_table(report: &Report, kind: ScenarioKind) -> Markup {
    let setting = Setting::trained(kind);
    let greedy = report.systems.iter().find(|system| system.name == GREEDY);
    let greedy = greedy.and_then(|system| system.table(setting));
    html! {
        figure {
            h3 { "Final parameters, " (setting.scenario_name()) ", K = " (setting.devices) ", B = " (setting.battery) }
            div.scroll { table {
                thead { tr {
                    th scope="col" { "system" } th scope="col" { "seeds" } th scope="col" { "steps" }
                    @for (metric, _) in METRICS { th scope="col" { (metric.name()) span.unit { (metric.unit()) } } }
                } }
                tbody {
                    tr.reference {
                        th scope="row" { (table::PAPER) ", MOSAC-ATT" } td { "3" } td { (grouped("1500000")) }
                        @for (metric, _) in METRICS { (table::published_cell(metric, setting)) }
                    }
                    @for training in &report.trainings { (final_row(training, kind)) }
                    @if let Some(greedy) = greedy {
                        tr.reference {
                            th scope="row" { (GREEDY) } td { "" } td { "" }
                            @for (metric, _) in METRICS { td { (metric.text(metric.of(&greedy))) } }
                        }
                    }
                }
            } }
            figcaption {
                "Mean over the seeds ± sample standard deviation, each seed on 100 evaluation realizations. No parameters are "
                "selected: the last ones count. From " code { "trainings.csv" } "."
            }
        }
    }
}

fn final_row(training: &Training, kind: ScenarioKind) -> Markup {
    let last = |metric| training.along(kind, metric).last().copied();
    html! {
        @if let Some(coverage) = last(METRICS[0].1) {
            tr {
                th scope="row" { (training.name) }
                td { (coverage.seeds) }
                td { (grouped(&coverage.steps.to_string())) }
                @for (metric, name) in METRICS {
                    @match last(name) {
                        Some(found) => td {
                            (metric.text(found.mean))
                            @if found.seeds > 1 { " ± " (metric.text(found.deviation)) }
                        },
                        None => td.missing { "not recorded" }
                    }
                }
            }
        }
    }
}

/// `trainings.csv`: every metric of the table along the training.
pub(super) fn trainings_csv(report: &Report) -> (&'static str, Vec<[String; 7]>) {
    let lines = report.trainings.iter().flat_map(|training| {
        ScenarioKind::ALL.into_iter().flat_map(move |kind| {
            METRICS.into_iter().flat_map(move |(_, name)| {
                training.along(kind, name).into_iter().map(move |point| {
                    [
                        training.name.clone(),
                        Setting::trained(kind).scenario_name().to_owned(),
                        point.steps.to_string(),
                        name.to_owned(),
                        point.seeds.to_string(),
                        point.mean.to_string(),
                        point.deviation.to_string(),
                    ]
                })
            })
        })
    });
    ("training,scenario,steps,name,seeds,mean,standard_deviation", lines.collect())
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
