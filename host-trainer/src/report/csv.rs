//! The numbers of the page as CSV files.

use super::Report;
use super::training::REPORTED;
use crate::judge::evaluation::{Missions, test_preferences};
use crate::judge::explanation::KINDS;
use crate::judge::paper::{CITATIONS, Setting};
use crate::judge::pareto::front;
use gleaner_world::ScenarioKind;

/// Name of the oracle in tables, legends and files.
pub(super) const ORACLE: &str = "ORACLE";
/// Columns that identify a line.
const ABOUT: &str = "system,scenario,devices,battery_units";

/// All files: name and content.
#[must_use]
pub fn files(report: &Report) -> Vec<(&'static str, String)> {
    vec![
        ("metrics.csv", metrics(report)),
        ("fronts.csv", fronts(report)),
        ("missions.csv", missions(report)),
        ("fading.csv", fading(report)),
        ("trajectories.csv", trajectories(report)),
        ("attention.csv", attention(report)),
        ("attention_initial.csv", attention_initial(report)),
        ("engines.csv", engines(report)),
        ("curves.csv", curves(report)),
        ("trainings.csv", trainings(report)),
        ("published.csv", published()),
    ]
}

fn file(head: &str, lines: impl IntoIterator<Item = String>) -> String {
    let mut text = format!("{head}\n");
    for line in lines {
        text += &line;
        text.push('\n');
    }
    text
}

/// Text as a field (RFC 4180), quoted where necessary.
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Empty for a number that was not measured.
fn optional(number: Option<impl ToString>) -> String {
    number.map_or_else(String::new, |number| number.to_string())
}

fn about(system: &str, setting: Setting) -> String {
    format!("{},{},{},{}", field(system), setting.scenario_name(), setting.devices, setting.battery)
}

/// All systems in all settings that were flown; the oracle is last.
fn flown(report: &Report) -> impl Iterator<Item = (String, Setting, &Missions)> {
    let systems = report.systems.iter().flat_map(|system| {
        let settings = Setting::ALL.into_iter().zip(&system.missions);
        settings.map(|(setting, missions)| (about(&system.name, setting), setting, missions))
    });
    let oracle = Setting::ALL.into_iter().filter_map(|setting| {
        report.oracle(setting).map(|oracle| (about(ORACLE, setting), setting, &oracle.missions))
    });
    systems.chain(oracle)
}

fn metrics(report: &Report) -> String {
    let head = format!(
        "{ABOUT},realizations,data_percent_at_w_data_1,data_percent_std,energy_at_w_data_0,energy_std,\
         average_utility,hypervolume_of_mean_front,mean_hypervolume,upper_bound_data_percent,realizations_bounded,\
         published_data_percent,published_energy"
    );
    let lines = flown(report).map(|(about, setting, missions)| {
        let table = missions.table();
        let published = setting.published();
        [
            about,
            missions.realizations().to_string(),
            table.coverage().to_string(),
            optional(table.rows.last().map(|row| row.data_std)),
            table.least_energy().to_string(),
            table.least_energy_std().to_string(),
            table.utility.to_string(),
            table.hypervolume.to_string(),
            table.mean_hypervolume.to_string(),
            optional(report.limits(setting).map(|limits| limits.data_percent)),
            report.oracle(setting).map_or(0, |oracle| oracle.upper_bound_percent.len()).to_string(),
            field(published.coverage.unwrap_or("")),
            published.least_energy.to_owned(),
        ]
        .join(",")
    });
    file(&head, lines)
}

fn fronts(report: &Report) -> String {
    let head = format!("{ABOUT},w_data,data_percent,data_percent_std,energy,energy_std,is_on_front");
    let lines = flown(report).flat_map(|(about, _, missions)| {
        let rows = missions.table().rows;
        let best = front(&rows.iter().map(|row| row.point()).collect::<Vec<_>>());
        let line = |row: crate::judge::evaluation::Row| {
            let is_on_front = best.contains(&row.point());
            let (w, data, data_std) = (row.w_data, row.data_percent, row.data_std);
            format!("{about},{w},{data},{data_std},{},{},{is_on_front}", row.energy, row.energy_std)
        };
        rows.into_iter().map(line).collect::<Vec<_>>()
    });
    file(&head, lines)
}

fn missions(report: &Report) -> String {
    let lines = flown(report).flat_map(|(about, _, missions)| {
        test_preferences().into_iter().zip(&missions.0).flat_map(move |(preference, totals)| {
            let (about, w) = (about.clone(), preference.w_data());
            totals
                .iter()
                .enumerate()
                .map(move |(number, total)| format!("{about},{w},{number},{},{}", total[0], -total[1]))
        })
    });
    file(&format!("{ABOUT},w_data,realization,data_percent,energy"), lines)
}

fn fading(report: &Report) -> String {
    let lines = report.details.iter().flat_map(|detail| {
        detail.fading.iter().flat_map(move |(kind, regular, fading)| {
            [("regular", regular), ("Rayleigh", fading)].into_iter().flat_map(move |(channel, repeats)| {
                let about = about(&detail.system, Setting::trained(*kind));
                let line = move |(repeat, percent)| format!("{about},{channel},{repeat},{percent}");
                repeats.0.iter().enumerate().map(line)
            })
        })
    });
    file(&format!("{ABOUT},channel,repeat,mean_data_percent"), lines)
}

fn trajectories(report: &Report) -> String {
    let lines = report.details.iter().flat_map(|detail| {
        detail.tracks.iter().flat_map(move |(kind, tracks)| {
            tracks.iter().flat_map(move |track| {
                let about = about(&detail.system, Setting::trained(*kind));
                let (example, w) = (report.example, track.w_data);
                let cells = track.cells.iter().enumerate();
                cells.map(move |(slot, (x, y))| format!("{about},{example},{w},{slot},{x},{y}"))
            })
        })
    });
    file(&format!("{ABOUT},realization,w_data,slot,x,y"), lines)
}

fn attention(report: &Report) -> String {
    let lines = report.details.iter().flat_map(|detail| {
        detail.gazes.iter().flat_map(move |gaze| {
            let (system, w) = (field(&detail.system), gaze.w_data);
            let shares = KINDS.into_iter().zip(gaze.along);
            shares.map(move |(tokens, share)| format!("{system},RD,{w},{tokens},{share}"))
        })
    });
    file("system,scenario,w_data,tokens,share_of_attention", lines)
}

fn attention_initial(report: &Report) -> String {
    let lines = report.details.iter().flat_map(|detail| {
        detail.gazes.iter().flat_map(move |gaze| {
            gaze.initial.iter().enumerate().flat_map(move |(query, row)| {
                let about = format!("{},RD,{},{}", field(&detail.system), report.example, gaze.w_data);
                row.iter().enumerate().map(move |(key, weight)| format!("{about},{query},{key},{weight}"))
            })
        })
    });
    file("system,scenario,realization,w_data,query,key,weight", lines)
}

fn engines(report: &Report) -> String {
    let lines = report.systems.iter().map(|system| {
        [
            field(&system.name),
            field(&system.origin),
            optional(system.parameters),
            optional(system.latency.map(|latency| latency.median_us)),
            optional(system.latency.map(|latency| latency.p99_us)),
            optional(system.latency.map(|latency| latency.decisions)),
            field(&report.machine),
        ]
        .join(",")
    });
    file("system,origin,parameters,median_us,p99_us,decisions,machine", lines)
}

fn curves(report: &Report) -> String {
    let seeds = report.trainings.iter().flat_map(|training| &training.runs);
    let lines = report.curves.iter().chain(seeds).flat_map(|(run, points)| {
        points.iter().flat_map(move |point| {
            let scalars = point.scalars.iter();
            scalars
                .map(move |(name, value)| format!("{},{},{},{value}", field(run), point.update, field(name)))
        })
    });
    file("run,update,name,value", lines)
}

fn trainings(report: &Report) -> String {
    let lines = report.trainings.iter().flat_map(|training| {
        ScenarioKind::ALL.into_iter().flat_map(move |kind| {
            REPORTED.into_iter().flat_map(move |name| {
                training.along(kind, name).into_iter().map(move |point| {
                    let (run, scenario) = (field(&training.name), Setting::trained(kind).scenario_name());
                    let (mean, deviation) = (point.mean, point.deviation);
                    format!("{run},{scenario},{},{name},{},{mean},{deviation}", point.steps, point.seeds)
                })
            })
        })
    });
    file("training,scenario,steps,name,seeds,mean,standard_deviation", lines)
}

fn published() -> String {
    let line = |cited: &crate::judge::paper::Citation| {
        format!("{},{},{}", field(cited.what), field(cited.value), field(cited.place))
    };
    file("what,value,place", CITATIONS.iter().map(line))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_with_commas_stays_one_field() {
        assert_eq!(field("run a, second \"try\""), "\"run a, second \"\"try\"\"\"");
        assert_eq!(field("GREEDY"), "GREEDY");
        let lines = published();
        assert_eq!(lines.lines().count(), CITATIONS.len() + 1);
        assert!(!lines.contains("\nbattery at w") && lines.contains("\n\"battery at w = (0, 1), RD"));
    }
}
