//! The page: one HTML file without external resources, for large and small screens and for print.

use super::attention::attention_section;
use super::section::section;
use super::seeds::trainings_section;
use super::table::{Metric, main_table, metric_table};
use super::{Detail, Report, figure};
use crate::judge::paper::{CITATIONS, EXAMPLES, Setting};
use gleaner_world::ScenarioKind;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// The report as one HTML page.
#[must_use]
pub fn page(report: &Report) -> String {
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Gleaner: the paper's tables and figures, measured" }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                (super::drawing::city(&report.heights))
                (head(report))
                (main_section(report))
                (trainings_section(report))
                (curves_section(report))
                (fronts_section(report))
                (trajectories_section(report))
                (fading_section(report))
                (engines_section(report))
                (generalization_section(report))
                (attention_section(report))
                (published_section())
            }
        }
    };
    markup.into_string()
}

fn head(report: &Report) -> Markup {
    html! {
        header {
            h1 { "The paper's tables and figures, measured" }
            p {
                "Every table and figure of " i { "Optimizing Energy and Data Collection in UAV-aided IoT Networks using "
                "Attention-based Multi-Objective Reinforcement Learning" } " (MOSAC-ATT), measured with Gleaner on "
                (report.realizations) " fixed evaluation realizations per setting and shown beside the numbers that the "
                "paper prints. The paper's city is not public, so its numbers come from another map: compare levels and "
                "order, not decimals."
            }
            p.quiet {
                "Made by " code { (report.command) } ". City " code { (format!("{:016x}", report.city_hash)) }
                ". The numbers behind the page are in the CSV files beside it."
            }
            nav {
                a href="#results" { "Results" }
                @if !report.trainings.is_empty() { a href="#seeds" { "Several seeds" } }
                a href="#curves" { "Learning curves" } a href="#fronts" { "Pareto fronts" }
                @if !report.details.is_empty() {
                    a href="#trajectories" { "Trajectories" } a href="#fading" { "Fading" }
                }
                a href="#engines" { "Size and time" } a href="#generalization" { "Generalization" }
                @if report.details.iter().any(Detail::has_attention) { a href="#attention" { "Attention" } }
                a href="#published" { "The paper's numbers" }
            }
            (tiles(report))
        }
    }
}

/// The first learned system at a glance.
fn tiles(report: &Report) -> Markup {
    let Some(system) = report.systems.get(1) else { return html! {} };
    let coverage = |kind| system.table(Setting::trained(kind)).map(|table| table.coverage());
    let energy = |kind| system.table(Setting::trained(kind)).map(|table| table.least_energy());
    let tile = |value: String, what: &str, paper: &str| {
        html! { li { span.value { (value) } span.what { (what) } span.paper { "paper: " (paper) } } }
    };
    let fading = report.details.first().and_then(|detail| detail.fading.first());
    html! {
        ul.tiles {
            @for (kind, name, paper) in [(ScenarioKind::ReachDestination, "RD", "about 87 %"), (ScenarioKind::ReturnBase, "RB", "about 85 %")] {
                @if let Some(coverage) = coverage(kind) {
                    (tile(format!("{coverage:.1} %"), &format!("data, {name}, K = 6, w = (1, 0)"), paper))
                }
            }
            @if let (Some(rd), Some(rb)) = (energy(ScenarioKind::ReachDestination), energy(ScenarioKind::ReturnBase)) {
                (tile(format!("{rd:.2} / {rb:.2}"), "battery units, RD / RB, w = (0, 1)", "32 / 2"))
            }
            @if let Some((_, regular, faded)) = fading {
                @let change = faded.mean_and_std().0 - regular.mean_and_std().0;
                (tile(points(change), "data under Rayleigh fading, RD", "\u{2212}0.26 points"))
            }
            @if let Some(parameters) = system.parameters {
                (tile(super::chart::grouped(&parameters.to_string()), "parameters", "91\u{2009}781"))
            }
            @if let Some(latency) = system.latency {
                (tile(format!("{:.3} ms", latency.median_us / 1000.0), "one decision, median", "2.0 ms, another processor"))
            }
        }
        p.quiet { (system.name) ": " (system.origin) "." }
    }
}

fn points(change: f32) -> String {
    let sign = if change < 0.0 { "" } else { "+" };
    format!("{sign}{} points", super::chart::grouped(&format!("{change:.2}")))
}

fn main_section(report: &Report) -> Markup {
    section(
        "results",
        "Results in the trained setting",
        html! {
            @for kind in ScenarioKind::ALL { (main_table(report, kind)) }
            p {
                "RD reaches a destination 32 cells away, RB returns to its base. Data is in percent of what all devices "
                "hold, energy in battery units; the preference w = (data, energy) weights the two. "
                "Hypervolume is the area above (\u{2212}1, \u{2212}200) that the eleven preferences dominate: for the front of "
                "their means, and as the mean over single realizations. The oracle knows map, channel and devices; its "
                "numbers are expected values of the best tour that it found. It is a strong search, "
                "not a proof."
                @if report.is_bounded() {
                    " No plan exceeds the proven bound in expectation. Branch and bound gives the bound of the data, and the "
                    "shortest mission that of the energy. The bounds of utility and hypervolume follow from these two and are loose."
                }
            }
        },
    )
}

fn curves_section(report: &Report) -> Markup {
    section(
        "curves",
        "Learning curves of the systems above",
        html! {
            @if report.curves.iter().all(|(_, points)| points.is_empty()) {
                p { "No run was given: pass its folder with " code { "--run" } "." }
            } @else {
                figure {
                    (figure::curves_legend(report))
                    div.panels.two {
                        @for kind in ScenarioKind::ALL {
                            div.panel { h3 { "Hypervolume, " (Setting::trained(kind).scenario_name()) } (figure::curves(report, kind)) }
                        }
                    }
                    figcaption {
                        "Hypervolume of the mean front on 60 validation realizations of the trained setting during training. The "
                        "best parameters are selected on these realizations; all other numbers of this page are from other "
                        "realizations. From " code { "curves.csv" } "."
                    }
                }
            }
        },
    )
}

fn fronts_section(report: &Report) -> Markup {
    section(
        "fronts",
        "Pareto fronts (figure 4 b, d)",
        html! {
            figure {
                (figure::systems_legend(report, false))
                div.panels.two {
                    @for kind in ScenarioKind::ALL {
                        div.panel { h3 { (Setting::trained(kind).scenario_name()) ", K = 6, B = 80" } (figure::front(report, kind)) }
                    }
                }
                figcaption {
                    b { "Figure 4 b, d. " } "One mark per preference, w = 0 to 1 in steps of 0.1: means over "
                    (report.realizations) " realizations. The line joins the non-dominated points; up and right is "
                    "better. The paper's fronts are a figure without printed numbers. From " code { "fronts.csv" } "."
                }
            }
        },
    )
}

fn trajectories_section(report: &Report) -> Markup {
    if report.details.is_empty() {
        return html! {};
    }
    let printed = |kind: ScenarioKind, w_data: f32| {
        let found = EXAMPLES.iter().find(|example| example.0 == kind && example.1 == w_data);
        found.map(|&(_, _, percent, units)| format!("{percent} %, {units} units"))
    };
    section(
        "trajectories",
        "Trajectories (figure 5)",
        html! {
            @for detail in &report.details {
                @for (kind, tracks) in &detail.tracks {
                    @let name = Setting::trained(*kind).scenario_name();
                    figure {
                        div.panels {
                            @for track in tracks {
                                div.panel {
                                    h3 { (detail.system) ", " (name) ", w = (" (track.w_data) ", " (1.0 - track.w_data) ")" }
                                    (figure::mission(report, name, track))
                                    p {
                                        (format!("{:.0} % of the data, {} units", track.data_percent, track.energy))
                                        @if let Some(printed) = printed(*kind, track.w_data) {
                                            br; span.quiet { "paper, its own example: " (printed) }
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            }
            figure { figcaption {
                b { "Figure 5. " } "Evaluation realization " (report.example) " for three preferences, north up. Darker roofs "
                "are higher. S start, T terminal, B base. Circles with a filled slice: devices, and the share of their data "
                "that was collected. Blue discs: hovering, larger for longer. From " code { "trajectories.csv" } "."
            } }
        },
    )
}

fn fading_section(report: &Report) -> Markup {
    if report.details.is_empty() {
        return html! {};
    }
    let all = || report.details.iter().flat_map(|detail| detail.fading.iter().map(move |row| (detail, row)));
    let rows = all().map(|(detail, (kind, regular, faded))| {
        let name = format!("{}, {}", detail.system, Setting::trained(*kind).scenario_name());
        (name, regular.mean_and_std(), faded.mean_and_std())
    });
    let repeats = all().next().map_or(0, |(_, (_, regular, _))| regular.0.len());
    section(
        "fading",
        "Robustness to fading (table I)",
        html! {
            figure {
                div.scroll { table {
                thead { tr {
                    th scope="col" { "system" } th scope="col" { "regular" span.unit { "%" } }
                    th scope="col" { "with fading" span.unit { "%" } } th scope="col" { "loss" span.unit { "points" } }
                } }
                tbody {
                    tr.reference {
                        th scope="row" { "paper, MOSAC-ATT" } td { "87.49 ± 0.16" } td { "87.23 ± 0.28" } td { "0.26" }
                    }
                    @for (name, regular, faded) in rows {
                        tr {
                            th scope="row" { (name) }
                            td { (format!("{:.2} ± {:.2}", regular.0, regular.1)) }
                            td { (format!("{:.2} ± {:.2}", faded.0, faded.1)) }
                            td { (super::chart::grouped(&format!("{:.2}", regular.0 - faded.0))) }
                        }
                    }
                }
                } }
                figcaption {
                    b { "Table I. " } "Data at w = (1, 0), K = 6, B = 80, percent: the mean over the realizations, flown "
                    (repeats) " times with other draws of the channel; mean and standard deviation of the "
                    (repeats) " means. With fading, every link gains 20 log10 |h| dB, |h| Rayleigh-distributed with scale "
                    "1. Policies are trained without. The paper does not say which scenario its table is of; its level is "
                    "RD's. The oracle was not computed under fading. From " code { "fading.csv" } "."
                }
            }
        },
    )
}

fn engines_section(report: &Report) -> Markup {
    section(
        "engines",
        "Size and inference time (section V-C)",
        html! {
            figure {
                div.scroll { table {
                thead { tr {
                    th scope="col" { "system" } th scope="col" { "parameters" }
                    th scope="col" { "median" span.unit { "ms" } } th scope="col" { "99 %" span.unit { "ms" } }
                    th.text scope="col" { "read from, flown by" }
                } }
                tbody {
                    tr.reference { th scope="row" { "paper, MOSAC-ATT" } td { "91\u{2009}781" } td { "2.0 (mean)" } td.missing { "not printed" } td.text { "" } }
                    tr.reference { th scope="row" { "paper, MOSAC-CGL" } td { "165\u{2009}829" } td { "1.3 (mean)" } td.missing { "not printed" } td.text { "" } }
                    @for system in &report.systems {
                        tr {
                            th scope="row" { (system.name) }
                            @match system.parameters {
                                Some(count) => td { (super::chart::grouped(&count.to_string())) },
                                None => td.missing { "none" }
                            }
                            @match system.latency {
                                Some(latency) => {
                                    td { (format!("{:.3}", latency.median_us / 1000.0)) }
                                    td { (format!("{:.3}", latency.p99_us / 1000.0)) }
                                }
                                None => { td.missing { "not measured" } td.missing { "not measured" } }
                            }
                            td.text { (system.origin) }
                        }
                    }
                }
                } }
                figcaption {
                    "Parameters of the policy that decides, and the time of one decision with one observation at a time: "
                    "median and 99th percentile, measured on " (report.machine) ". The time includes building the tokens. "
                    "The paper measured on an Intel Xeon Gold 6278C with 4 cores. From " code { "engines.csv" } "."
                }
            }
        },
    )
}

fn generalization_section(report: &Report) -> Markup {
    let shown = [Metric::Coverage, Metric::LeastEnergy, Metric::Utility];
    section(
        "generalization",
        "Generalization to other numbers of devices (figure 6)",
        html! {
            figure {
                (figure::systems_legend(report, true))
                @for kind in ScenarioKind::ALL {
                    div.panels {
                        @for metric in shown {
                            div.panel {
                                h3 { (Setting::trained(kind).scenario_name()) ", " (metric.name()) }
                                (figure::generalization(report, kind, metric))
                            }
                        }
                    }
                }
                figcaption {
                    b { "Figure 6. " } "By number of devices K; B = 80, and B = 100 for K = 10. The trained setting is "
                    "highlighted. Stars: numbers that the paper prints for MOSAC-ATT. Error bars of the battery: standard deviation over the realizations. From "
                    code { "metrics.csv" } "."
                }
            }
            @for metric in Metric::ALL { (metric_table(report, metric)) }
        },
    )
}

fn published_section() -> Markup {
    section(
        "published",
        "The paper's printed numbers",
        html! {
            p {
                "All numbers of its results that the paper prints in text or table. Where this page says \"not printed\", "
                "the paper has a figure only, and nothing was read off a picture. From " code { "published.csv" } "."
            }
            div.scroll { table.words {
                thead { tr { th scope="col" { "what" } th scope="col" { "value" } th scope="col" { "place" } } }
                tbody {
                    @for cited in &CITATIONS {
                        tr { th scope="row" { (cited.what) } td { (cited.value) } td { (cited.place) } }
                    }
                }
            } }
        },
    )
}
