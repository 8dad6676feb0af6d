//! The section on trainings with several seeds: mean and standard deviation, along the training and at its end.

use super::Report;
use super::chart::{Axis, Joined, Series, Spot, grouped, legend, look, plot};
use super::section::section;
use super::table::{self, Metric};
use super::training::{REPORTED, Training};
use crate::judge::paper::Setting;
use gleaner_world::ScenarioKind;
use maud::{Markup, html};

/// The metrics of the table, in the order of [`REPORTED`].
const METRICS: [Metric; REPORTED.len()] = [Metric::Coverage, Metric::LeastEnergy, Metric::MeanHypervolume];

/// The section with curves and table; empty without trainings.
pub(super) fn trainings_section(report: &Report) -> Markup {
    if report.trainings.is_empty() {
        return html! {};
    }
    section(
        "seeds",
        "Trainings with several seeds (figure 4 a, c)",
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
                    b { "Figure 4 a, c. " } "Mean over the seeds, and a band of one standard deviation, on the realizations of "
                    "each run's own validation. With " code { "--preset paper" } " these are the 100 evaluation realizations, as in "
                    "the paper. The shipped runs train RD and RB apart. The paper says that MOSAC-ATT leads after approximately 150\u{2009}000 steps. From " code { "trainings.csv" } "."
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
    // GREEDY is the first.
    let greedy = report.systems.first().and_then(|system| Some((&system.name, system.table(setting)?)));
    html! {
        figure {
            h3 { "Final parameters, " (setting.scenario_name()) ", K = " (setting.devices) ", B = " (setting.battery) }
            div.scroll { table {
                thead { tr {
                    th scope="col" { "system" } th scope="col" { "seeds" } th scope="col" { "steps" }
                    @for metric in METRICS { th scope="col" { (metric.name()) span.unit { (metric.unit()) } } }
                } }
                tbody {
                    tr.reference {
                        th scope="row" { (table::PAPER) ", MOSAC-ATT" } td { "3" } td { (grouped("1500000")) }
                        @for metric in METRICS { (table::published_cell(metric, setting)) }
                    }
                    @for training in &report.trainings { (final_row(training, kind)) }
                    @if let Some((name, greedy)) = greedy {
                        tr.reference {
                            th scope="row" { (name) } td { "" } td { "" }
                            @for metric in METRICS { td { (metric.text(metric.of(&greedy))) } }
                        }
                    }
                }
            } }
            figcaption {
                "Mean over the seeds ± sample standard deviation, on the realizations of the curves above; GREEDY on "
                (report.realizations) " evaluation realizations. No parameters are selected: the last ones count, or those after the steps that all seeds have reached. From " code { "trainings.csv" } "."
            }
        }
    }
}

fn final_row(training: &Training, kind: ScenarioKind) -> Markup {
    let last = |metric| training.along(kind, metric).last().copied();
    html! {
        @if let Some(coverage) = last(REPORTED[0]) {
            tr {
                th scope="row" { (training.name) }
                td { (coverage.seeds) }
                td { (grouped(&coverage.steps.to_string())) }
                @for (metric, name) in METRICS.into_iter().zip(REPORTED) {
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
