//! The figures.

use super::chart::{Axis, BOUND, Joined, Look, ORACLE, PAPER, Series, Spot, heat_map, legend, look, plot};
use super::table::Metric;
use super::{Detail, Report, csv, drawing, table};
use crate::judge::evaluation::Table;
use crate::judge::explanation::{Gaze, KINDS, Track};
use crate::judge::paper::Setting;
use crate::judge::pareto::front as best_of;
use gleaner_world::ScenarioKind;
use maud::{Markup, html};

/// Numbers of devices in the paper's charts.
const PER_SCENARIO: usize = 5;

/// The systems, the oracle if it was computed, and if requested the bound and the paper.
pub(super) fn systems_legend(report: &Report, with_references: bool) -> Markup {
    let mut entries: Vec<(String, Look)> =
        report.systems.iter().enumerate().map(|(place, system)| (system.name.clone(), look(place))).collect();
    if !report.oracle.is_empty() {
        entries.push((csv::ORACLE.into(), ORACLE));
    }
    if with_references {
        if report.is_bounded() {
            entries.push((table::BOUND.into(), BOUND));
        }
        entries.push((format!("{}, MOSAC-ATT", table::PAPER), PAPER));
    }
    html! {
        (legend(&entries))
        @if report.oracle.is_empty() { p.quiet { "The oracle was not computed for this report." } }
    }
}

/// Energy over data for each preference.
pub(super) fn front(report: &Report, kind: ScenarioKind) -> Markup {
    let setting = Setting::trained(kind);
    let mut all: Vec<(&str, Look, Table)> = Vec::new();
    if let Some(oracle) = report.oracle(setting) {
        all.push((csv::ORACLE, ORACLE, oracle.missions.table()));
    }
    for (place, system) in report.systems.iter().enumerate() {
        all.extend(system.table(setting).map(|table| (system.name.as_str(), look(place), table)));
    }
    let mut series = Vec::new();
    for (name, look, table) in &all {
        let line = best_of(&table.rows.iter().map(|row| row.point()).collect::<Vec<_>>());
        let spots = line.iter().map(|p| spot(f64::from(p[0]), f64::from(-p[1]), String::new()));
        series.push(Series { look: *look, spots: spots.collect(), joined: Joined::LineWithoutMarks });
        let marks = table.rows.iter().map(|row| {
            let said =
                format!("{name}, w = {:.1}: {:.1} %, {:.1} units", row.w_data, row.data_percent, row.energy);
            spot(f64::from(row.data_percent), f64::from(row.energy), said)
        });
        series.push(Series { look: *look, spots: marks.collect(), joined: Joined::Not });
    }
    let x = Axis::around("data collected, %", std::iter::empty(), [Some(0.0), Some(100.0)]);
    let energies = series.iter().flat_map(|one| one.spots.iter().map(|spot| spot.y));
    let y = Axis::around("battery units used (up is less)", energies, [Some(0.0), None]).reversed();
    let words = format!("Pareto fronts, {}: battery units over data collected", setting.scenario_name());
    plot(&words, &x, &y, &series, None)
}

fn spot(x: f64, y: f64, said: String) -> Spot {
    Spot { x, y, spread: 0.0, said }
}

/// One metric by number of devices.
pub(super) fn generalization(report: &Report, kind: ScenarioKind, metric: Metric) -> Markup {
    let settings: Vec<Setting> = Setting::ALL.into_iter().filter(|setting| setting.kind == kind).collect();
    let names: Vec<String> =
        settings
            .iter()
            .map(|s| {
                if s.battery == 80 {
                    s.devices.to_string()
                } else {
                    format!("{} (B {})", s.devices, s.battery)
                }
            })
            .collect();
    let columns = report.systems.len() + 1;
    // Shifted, so that equal values do not cover each other.
    let aside = |column: usize| (column as f64 - 0.5 * (columns - 1) as f64) * (0.66 / columns as f64);
    let mut series = Vec::new();
    for (place, system) in report.systems.iter().enumerate() {
        let spots = settings.iter().enumerate().filter_map(|(index, &setting)| {
            let table = system.table(setting)?;
            Some(table_spot(&system.name, metric, &table, index as f64 + aside(place)))
        });
        series.push(Series { look: look(place), spots: spots.collect(), joined: Joined::Not });
    }
    let oracle = settings.iter().enumerate().filter_map(|(index, &setting)| {
        let table = report.oracle(setting)?.missions.table();
        Some(table_spot(csv::ORACLE, metric, &table, index as f64 + aside(columns - 1)))
    });
    series.push(Series { look: ORACLE, spots: oracle.collect(), joined: Joined::Not });
    let bound = settings.iter().enumerate().filter_map(|(index, &setting)| {
        let limit = metric.limit(setting, report.limits(setting))?;
        Some(spot(
            index as f64 + aside(columns - 1),
            limit,
            format!("{}: {}", table::BOUND, metric.text(limit)),
        ))
    });
    series.push(Series { look: BOUND, spots: bound.collect(), joined: Joined::Not });
    series.push(Series { look: PAPER, spots: printed(&settings, metric), joined: Joined::Not });

    let values = series.iter().flat_map(|one| &one.spots).flat_map(|s| [s.y - s.spread, s.y + s.spread]);
    let fixed = match metric {
        Metric::Coverage => [None, Some(100.0)],
        Metric::LeastEnergy => [Some(0.0), None],
        _ => [None, None],
    };
    let y = Axis::around(&format!("{}, {}", metric.name(), metric.unit()), values, fixed);
    let x = Axis::of_names("number of devices K", &names);
    let trained = settings.iter().position(|&setting| setting == Setting::trained(kind)).unwrap_or(0) as f64;
    let words = format!("{} by number of devices", metric.name());
    debug_assert_eq!(settings.len(), PER_SCENARIO);
    plot(&words, &x, &y, &series, Some((trained - 0.5, trained + 0.5)))
}

fn table_spot(name: &str, metric: Metric, table: &Table, x: f64) -> Spot {
    let y = metric.of(table);
    Spot { x, y, spread: metric.spread(table), said: format!("{name}: {}", metric.text(y)) }
}

/// The numbers that the paper prints.
fn printed(settings: &[Setting], metric: Metric) -> Vec<Spot> {
    let text = |setting: &Setting| match metric {
        Metric::Coverage => setting.published().coverage,
        Metric::LeastEnergy => Some(setting.published().least_energy),
        _ => None,
    };
    let of_one = |(index, setting): (usize, &Setting)| {
        let text = text(setting)?;
        let value: f64 = text.trim_start_matches("about ").parse().ok()?;
        Some(spot(index as f64 - 0.42, value, format!("paper: {text}")))
    };
    settings.iter().enumerate().filter_map(of_one).collect()
}

/// The style of a run: that of its system, or one of its own if it is only a curve.
fn curve_look(report: &Report, place: usize, name: &str) -> Look {
    let system = report.systems.iter().position(|system| system.name == name);
    look(system.unwrap_or(report.systems.len() + place))
}

/// The runs of the learning curves.
pub(super) fn curves_legend(report: &Report) -> Markup {
    let entries: Vec<(String, Look)> = report
        .curves
        .iter()
        .enumerate()
        .map(|(place, (name, _))| (name.clone(), curve_look(report, place, name)))
        .collect();
    legend(&entries)
}

/// Hypervolume over environment steps.
pub(super) fn curves(report: &Report, kind: ScenarioKind) -> Markup {
    let key = format!("{}/hypervolume", kind.name());
    let series: Vec<Series> = report
        .curves
        .iter()
        .enumerate()
        .map(|(place, (name, points))| {
            let told = points.iter().filter_map(|point| {
                let (value, steps) = (*point.scalars.get(&key)?, point.steps()?);
                Some(spot(steps as f64 / 1000.0, value, format!("{name}, {steps} steps: {value:.0}")))
            });
            let spots: Vec<Spot> = told.collect();
            // Marks are readable only for few runs.
            let joined = if spots.len() > 40 { Joined::LineWithoutMarks } else { Joined::Line };
            Series { look: curve_look(report, place, name), spots, joined }
        })
        .collect();
    let spots = || series.iter().flat_map(|one| &one.spots);
    if spots().next().is_none() {
        return html! { p.quiet { "None of the runs was validated in this scenario." } };
    }
    let x = Axis::around("environment steps, thousands", spots().map(|spot| spot.x), [Some(0.0), None]);
    let y = Axis::around("hypervolume", spots().map(|spot| spot.y), [None, None]);
    plot(&format!("learning curves, {kind}"), &x, &y, &series, None)
}

/// One mission in the city.
pub(super) fn mission(report: &Report, name: &str, track: &Track) -> Markup {
    let words = format!(
        "{name} mission at w = {}: {:.0} percent of the data, {} battery units",
        track.w_data, track.data_percent, track.energy
    );
    drawing::mission(&words, &report.heights, track)
}

/// The attention matrix of the first slot.
pub(super) fn attention(gaze: &Gaze) -> Markup {
    let is_present = |token: usize| gaze.initial[token].iter().sum::<f32>() > 0.0;
    let names: Vec<String> = (0..gaze.initial.len())
        .map(|token| match token {
            0 => "UAV".into(),
            1 => "preference".into(),
            2 => "map".into(),
            _ if is_present(token) => format!("device {}", token - 2),
            _ => String::new(),
        })
        .collect();
    let matrix: Vec<Vec<f32>> = gaze.initial.iter().map(|row| row.to_vec()).collect();
    let strongest = matrix.iter().flatten().copied().fold(0.0, f32::max);
    let words = format!("attention matrix at w = {}", gaze.w_data);
    html! {
        (heat_map(&words, &names, &matrix, strongest))
        p.quiet { (format!("darkest: {strongest:.2}; each row adds to 1")) }
    }
}

/// The two preferences of the attention analysis.
pub(super) fn shares_legend(detail: &Detail) -> Markup {
    let name = |gaze: &Gaze| format!("w = ({}, {})", gaze.w_data, 1.0 - gaze.w_data);
    let entries: Vec<(String, Look)> =
        detail.gazes.iter().enumerate().map(|(place, gaze)| (name(gaze), look(place + 1))).collect();
    legend(&entries)
}

/// Share of all attention by kind of token.
pub(super) fn shares(detail: &Detail) -> Markup {
    let series: Vec<Series> = detail
        .gazes
        .iter()
        .enumerate()
        .map(|(place, gaze)| {
            let bars = KINDS.iter().zip(gaze.along).enumerate().map(|(index, (kind, share))| {
                let x = index as f64 + 0.38 * (place as f64 - 0.5 * (detail.gazes.len() - 1) as f64);
                spot(x, 100.0 * f64::from(share), format!("{kind}: {:.1} %", 100.0 * share))
            });
            Series { look: look(place + 1), spots: bars.collect(), joined: Joined::Bars }
        })
        .collect();
    let heights = series.iter().flat_map(|one| one.spots.iter().map(|spot| spot.y));
    let y = Axis::around("share of all attention, %", heights, [Some(0.0), None]);
    let x = Axis::of_names("kind of token", &KINDS.map(str::to_owned));
    plot("share of attention by kind of token", &x, &y, &series, None)
}
