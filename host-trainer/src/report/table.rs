//! The tables: systems, oracle and bound, with a note in place of a missing number.

use super::Report;
use super::chart::grouped;
use super::csv::ORACLE;
use crate::judge::evaluation::Table;
use crate::judge::paper::{Bounds, Setting};
use gleaner_world::ScenarioKind;
use maud::{Markup, html};

/// Name of the bound in tables and legends.
pub(super) const BOUND: &str = "proven bound";
/// Name of the paper's numbers.
pub(super) const PAPER: &str = "paper";
const NOT_COMPUTED: &str = "not computed";

/// One of the paper's metrics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Metric {
    Coverage,
    LeastEnergy,
    Utility,
    Hypervolume,
    MeanHypervolume,
}

impl Metric {
    pub const ALL: [Metric; 5] = [
        Metric::Coverage,
        Metric::LeastEnergy,
        Metric::Utility,
        Metric::Hypervolume,
        Metric::MeanHypervolume,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Metric::Coverage => "data at w = (1, 0)",
            Metric::LeastEnergy => "battery at w = (0, 1)",
            Metric::Utility => "average utility",
            Metric::Hypervolume => "hypervolume of the mean front",
            Metric::MeanHypervolume => "mean hypervolume",
        }
    }

    /// The heading.
    pub const fn title(self) -> &'static str {
        match self {
            Metric::Coverage => "Data at w = (1, 0)",
            Metric::LeastEnergy => "Battery at w = (0, 1)",
            Metric::Utility => "Average utility",
            Metric::Hypervolume => "Hypervolume of the mean front",
            Metric::MeanHypervolume => "Mean hypervolume",
        }
    }

    pub const fn unit(self) -> &'static str {
        match self {
            Metric::Coverage => "% of the data",
            Metric::LeastEnergy => "battery units",
            Metric::Utility => "w \u{b7} (%, \u{2212}units)",
            Metric::Hypervolume | Metric::MeanHypervolume => "% \u{d7} units",
        }
    }

    pub fn of(self, table: &Table) -> f64 {
        match self {
            Metric::Coverage => f64::from(table.coverage()),
            Metric::LeastEnergy => f64::from(table.least_energy()),
            Metric::Utility => f64::from(table.utility),
            Metric::Hypervolume => table.hypervolume,
            Metric::MeanHypervolume => table.mean_hypervolume,
        }
    }

    /// Standard deviation over the realizations, for metrics where the paper gives it.
    pub fn spread(self, table: &Table) -> f64 {
        if self == Metric::LeastEnergy { f64::from(table.least_energy_std()) } else { 0.0 }
    }

    /// The bound. That of energy needs no computation.
    pub fn limit(self, setting: Setting, limits: Option<Bounds>) -> Option<f64> {
        match self {
            Metric::Coverage => limits.map(|limits| f64::from(limits.data_percent)),
            Metric::LeastEnergy => Some(f64::from(setting.least_energy())),
            Metric::Utility => limits.map(|limits| f64::from(limits.utility())),
            Metric::Hypervolume => limits.map(Bounds::hypervolume),
            // With one side fixed, the mean area is the area of the mean side.
            Metric::MeanHypervolume => limits.map(Bounds::hypervolume),
        }
    }

    pub fn text(self, value: f64) -> String {
        match self {
            Metric::Coverage => format!("{value:.1}"),
            Metric::LeastEnergy | Metric::Utility => grouped(&format!("{value:.2}")),
            Metric::Hypervolume | Metric::MeanHypervolume => grouped(&format!("{value:.0}")),
        }
    }

    fn published(self, setting: Setting) -> Option<&'static str> {
        match self {
            Metric::Coverage => setting.published().coverage,
            Metric::LeastEnergy => Some(setting.published().least_energy),
            Metric::Utility | Metric::Hypervolume | Metric::MeanHypervolume => None,
        }
    }

    fn is_better(self, a: f64, b: f64) -> bool {
        if self == Metric::LeastEnergy { a < b } else { a > b }
    }
}

/// A number, its deviation, and its share of the oracle's number.
fn cell(metric: Metric, table: &Table, oracle: Option<&Table>, is_best: bool) -> Markup {
    let value = metric.of(table);
    html! {
        td.best[is_best] {
            (metric.text(value))
            @if metric == Metric::LeastEnergy { " ± " (format!("{:.2}", metric.spread(table))) }
            @if let Some(share) = share_of_oracle(metric, value, oracle) { small { (share) } }
        }
    }
}

fn share_of_oracle(metric: Metric, value: f64, oracle: Option<&Table>) -> Option<String> {
    let oracle = metric.of(oracle?);
    let has_share = matches!(metric, Metric::Coverage | Metric::Hypervolume | Metric::MeanHypervolume);
    (has_share && oracle > 0.0).then(|| format!("{:.1} % of oracle", 100.0 * value / oracle))
}

fn missing() -> Markup {
    html! { td.missing { (NOT_COMPUTED) } }
}

fn limit_cell(metric: Metric, setting: Setting, limits: Option<Bounds>) -> Markup {
    metric.limit(setting, limits).map_or_else(missing, |limit| html! { td { (metric.text(limit)) } })
}

/// Systems in rows, metrics in columns: one scenario in the trained setting.
pub(super) fn main_table(report: &Report, kind: ScenarioKind) -> Markup {
    let setting = Setting::trained(kind);
    let tables: Vec<Option<Table>> = report.systems.iter().map(|system| system.table(setting)).collect();
    let oracle = report.oracle(setting).map(|oracle| oracle.missions.table());
    let compared = oracle.as_ref().filter(|_| report.compares(setting));
    let limits = report.limits(setting);
    let best = |metric: Metric| best_of(metric, tables.iter().flatten());
    html! {
        figure {
            h3 { (setting.scenario_name()) ", K = " (setting.devices) ", B = " (setting.battery) }
            div.scroll { table {
            thead { tr {
                th scope="col" { "system" }
                @for metric in Metric::ALL { th scope="col" { (metric.name()) span.unit { (metric.unit()) } } }
            } }
            tbody {
                tr.reference {
                    th scope="row" { (PAPER) ", MOSAC-ATT" }
                    @for metric in Metric::ALL { (published_cell(metric, setting)) }
                }
                @for (system, table) in report.systems.iter().zip(&tables) {
                    tr {
                        th scope="row" { (system.name) }
                        @for metric in Metric::ALL {
                            @match table {
                                Some(table) => {
                                    (cell(metric, table, compared, best(metric) == Some(metric.of(table))))
                                }
                                None => (missing())
                            }
                        }
                    }
                }
                tr.reference {
                    th scope="row" { (ORACLE) }
                    @for metric in Metric::ALL {
                        @match &oracle { Some(table) => (cell(metric, table, None, false)), None => (missing()) }
                    }
                }
                @if report.is_bounded() {
                    tr.reference {
                        th scope="row" { (BOUND) }
                        @for metric in Metric::ALL { (limit_cell(metric, setting, limits)) }
                    }
                }
            }
            } }
            figcaption {
                "Mean over " (report.realizations) " realizations; ± is their standard deviation. Bold: the best "
                "of the systems. From " code { "metrics.csv" } ". " (bounded(report, setting))
            }
        }
    }
}

/// Settings in rows, systems in columns: one metric.
pub(super) fn metric_table(report: &Report, metric: Metric) -> Markup {
    html! {
        figure {
            h3 { (metric.title()) ", " (metric.unit()) }
            div.scroll { table {
            thead { tr {
                th scope="col" { "setting" }
                th scope="col" { (PAPER) span.unit { "MOSAC-ATT" } }
                @for system in &report.systems { th scope="col" { (system.name) } }
                th scope="col" { (ORACLE) }
                @if report.is_bounded() { th scope="col" { (BOUND) } }
            } }
            tbody { @for setting in Setting::ALL { (metric_row(report, metric, setting)) } }
            } }
            figcaption {
                "Mean over " (report.realizations) " realizations per row; the trained setting is highlighted. From "
                code { "metrics.csv" } "."
            }
        }
    }
}

fn metric_row(report: &Report, metric: Metric, setting: Setting) -> Markup {
    let tables: Vec<Option<Table>> = report.systems.iter().map(|system| system.table(setting)).collect();
    let oracle = report.oracle(setting).map(|oracle| oracle.missions.table());
    let compared = oracle.as_ref().filter(|_| report.compares(setting));
    let best = best_of(metric, tables.iter().flatten());
    html! {
        tr.trained[setting == Setting::trained(setting.kind)] {
            th scope="row" { (setting.scenario_name()) ", K = " (setting.devices) ", B = " (setting.battery) }
            (published_cell(metric, setting))
            @for table in &tables {
                @match table {
                    Some(table) => (cell(metric, table, compared, best == Some(metric.of(table)))),
                    None => (missing()),
                }
            }
            @match &oracle { Some(table) => (cell(metric, table, None, false)), None => (missing()) }
            @if report.is_bounded() { (limit_cell(metric, setting, report.limits(setting))) }
        }
    }
}

pub(super) fn published_cell(metric: Metric, setting: Setting) -> Markup {
    match metric.published(setting) {
        Some(text) => html! { td { (text) } },
        None => html! { td.missing { "not printed" } },
    }
}

fn best_of<'a>(metric: Metric, tables: impl Iterator<Item = &'a Table>) -> Option<f64> {
    tables.map(|table| metric.of(table)).reduce(|a, b| if metric.is_better(b, a) { b } else { a })
}

/// A note on the computed part of the bound.
fn bounded(report: &Report, setting: Setting) -> String {
    match report.oracle(setting) {
        None => format!("{ORACLE} was not computed for this report."),
        Some(oracle) => {
            let flown = oracle.missions.realizations();
            let bounded = oracle.upper_bound_percent.len();
            let oracle = format!("{ORACLE}: {flown} realizations");
            if !report.is_bounded() {
                return oracle + ".";
            }
            let bound = if bounded == 0 { "not computed".into() } else { format!("{bounded} realizations") };
            format!("{oracle}; {BOUND} of the data: {bound}.")
        }
    }
}
