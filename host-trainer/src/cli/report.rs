//! `gleaner-train report`.

use super::chosen::Chosen;
use super::site::{SiteArguments, fingerprint};
use super::subject::Subject;
use super::{oracle, write_whole};
use anyhow::{Result, bail};
use gleaner_host_trainer::env::site::Site;
use gleaner_host_trainer::judge::evaluation::{fly_all, fly_greedy, test_preferences};
use gleaner_host_trainer::judge::explanation::{track, watch};
use gleaner_host_trainer::judge::paper::Setting;
use gleaner_host_trainer::judge::robustness::{repeat_flights, world_with};
use gleaner_host_trainer::keep::parts::{Parts, Source};
use gleaner_host_trainer::planner::oracle::OracleSetting;
use gleaner_host_trainer::report::{self, Detail, Report};
use gleaner_policy::Preference;
use gleaner_units::BatteryUnits;
use gleaner_world::{Fading, Realization, ScenarioKind, Seed};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::io::IsTerminal;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// An ONNX model, in the engine that flies it on board; NAME=FILE gives it a name. Repeatable. The first system of
    /// all and those with attention are measured in detail: fading, attention, trajectories. Without --model and --run:
    /// all that is in models/.
    #[arg(long, value_name = "[NAME=]FILE")]
    model: Vec<String>,
    /// The folder of a run: its best parameters and its learning curve; NAME=FOLDER gives it a name. Repeatable.
    #[arg(long, value_name = "[NAME=]FOLDER")]
    run: Vec<String>,
    /// The folder of a run of which the report shows the learning curve only. Repeatable: curves of the same NAME are
    /// seeds of one training and become a mean with a standard deviation.
    #[arg(long, value_name = "[NAME=]FOLDER")]
    curve: Vec<String>,
    /// A file of `gleaner-train oracle`, for every table [default: the shipped one].
    #[arg(long, value_name = "FILE")]
    oracle: Option<PathBuf>,
    /// Folder of the page, the CSV files and the finished parts.
    #[arg(long, default_value = "target/report")]
    out: PathBuf,
    #[command(flatten)]
    site: SiteArguments,
    /// Evaluation realizations per setting, numbers 0 to N - 1.
    #[arg(long, default_value_t = 100)]
    realizations: u64,
    /// Repeats of the fading test.
    #[arg(long, default_value_t = 30)]
    fading_repeats: u32,
    /// Evaluation realization of the example figures.
    #[arg(long, default_value_t = 0)]
    example: u64,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.realizations == 0 {
        bail!("--realizations 0: no mission to fly; give at least 1");
    }
    let chosen = Chosen::by(&arguments.model, &arguments.run, &arguments.curve);
    let mut systems = chosen.systems()?;
    let is_default_site = arguments.site.is_default();
    // The oracle's file is about the default city.
    let lines = match &arguments.oracle {
        None if !is_default_site => Vec::new(),
        named => oracle::read_or_shipped(named.as_deref())?,
    };
    let oracle = same_realizations(&lines, arguments.realizations);
    let (curves, trainings) = (chosen.curves()?, chosen.trainings()?);
    let detailed = systems.iter().enumerate().filter(|(place, system)| is_detailed(*place, system)).count();
    let measurement = Measurement::open(arguments, systems.len(), detailed)?;
    let mut shown = vec![measurement.greedy()?];
    for system in &mut systems {
        shown.push(measurement.evaluate(system)?);
    }
    let mut details = Vec::new();
    for (place, system) in systems.iter_mut().enumerate() {
        if is_detailed(place, system) {
            details.push(measurement.detail(system)?);
        }
    }
    measurement.bar.finish_and_clear();
    let world = measurement.site.world();
    let report = Report {
        command: command_line(),
        machine: machine(),
        realizations: arguments.realizations,
        example: arguments.example,
        heights: world.city().heights().clone(),
        city_hash: world.city().fingerprint(),
        systems: shown,
        oracle,
        details,
        curves,
        trainings,
    };
    for (name, text) in report::files(&report) {
        write_whole(&arguments.out.join(name), text.as_bytes())?;
    }
    let page = arguments.out.join("report.html");
    write_whole(&page, report::page(&report).as_bytes())?;
    println!("wrote {}, and the CSV files beside it", page.display());
    Ok(())
}

/// Whether a system is measured in detail.
fn is_detailed(place: usize, system: &Subject) -> bool {
    place == 0 || system.policy.has_attention()
}

/// Measures parts and shows the progress.
struct Measurement<'a> {
    arguments: &'a Arguments,
    site: Site,
    parts: Parts,
    bar: ProgressBar,
}

impl<'a> Measurement<'a> {
    fn open(arguments: &'a Arguments, systems: usize, detailed: usize) -> Result<Measurement<'a>> {
        let parts = Parts::open(&arguments.out.join("parts"))?;
        let parts_of_detail = 4 + 2 + 2;
        let count = Setting::ALL.len() * (systems + 1) + systems + detailed * parts_of_detail;
        let bar = ProgressBar::new(count as u64);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} parts, {elapsed}, now {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Ok(Measurement { arguments, site: arguments.site.site()?, parts, bar })
    }

    /// One part, from the folder if it is there.
    fn part<T: Serialize + DeserializeOwned>(
        &self,
        system: &str,
        identity: &str,
        what: &str,
        measure: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        self.bar.set_message(format!("{system}: {what}"));
        let city = fingerprint(&self.site);
        let count = self.arguments.realizations;
        let facts = format!("{identity}, {what}, {count} realizations, city {city}");
        let (part, source) = self.parts.part(&facts, measure)?;
        self.bar.inc(1);
        match source {
            Source::Repaired => self.print(&format!("{system}: {what}: damaged part, measured again")),
            Source::Measured if !std::io::stderr().is_terminal() => {
                self.print(&format!("{system}: {what}: done"));
            }
            Source::Measured | Source::Kept => {}
        }
        Ok(part)
    }

    fn print(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
    }

    fn draw(&self, setting: Setting) -> Result<Vec<(Seed, Realization)>> {
        let scenario = self
            .site
            .scenario(setting.kind)
            .with_devices(setting.devices)
            .with_battery(BatteryUnits(f32::from(setting.battery)));
        let draw = |number| {
            let seed = Seed::evaluation(number);
            Ok((seed, self.site.realization(&scenario, seed)?))
        };
        (0..self.arguments.realizations).map(draw).collect()
    }

    fn greedy(&self) -> Result<report::System> {
        let missions = Setting::ALL
            .iter()
            .map(|&setting| {
                self.part("GREEDY", "greedy", &name(setting), || {
                    Ok(fly_greedy(self.site.world(), &self.draw(setting)?))
                })
            })
            .collect::<Result<_>>()?;
        Ok(report::System {
            name: "GREEDY".into(),
            origin:
                "nearest device first; for each preference the number of visits with the best mean utility"
                    .into(),
            parameters: None,
            latency: None,
            missions,
        })
    }

    fn evaluate(&self, system: &mut Subject) -> Result<report::System> {
        let identity = system.identity.clone();
        let missions = Setting::ALL
            .iter()
            .map(|&setting| {
                self.part(&system.name, &identity, &name(setting), || {
                    let drawn = self.draw(setting)?;
                    let preferences = test_preferences();
                    Ok(fly_all(self.site.world(), &drawn, &preferences, system.policy.decider().as_mut())?)
                })
            })
            .collect::<Result<_>>()?;
        let facts = format!("{identity}, {}", machine());
        let latency =
            self.part(&system.name, &facts, "inference time", || system.policy.latency(self.site.world()))?;
        Ok(report::System {
            name: system.name.clone(),
            origin: system.origin.clone(),
            parameters: Some(system.policy.parameters()),
            latency: Some(latency),
            missions,
        })
    }

    /// The measurements that the paper makes for MOSAC-ATT only.
    fn detail(&self, system: &mut Subject) -> Result<Detail> {
        let (name, identity) = (system.name.clone(), system.identity.clone());
        let mut detail =
            Detail { system: name.clone(), fading: Vec::new(), gazes: Vec::new(), tracks: Vec::new() };
        let repeats = self.arguments.fading_repeats;
        for kind in ScenarioKind::ALL {
            let drawn = self.draw(Setting::trained(kind))?;
            let mut fly = |what: &str, fading| {
                let what = format!("{what} channel, {repeats} repeats, {kind}");
                self.part(&name, &identity, &what, || {
                    let world = world_with(self.site.world().city().clone(), fading);
                    Ok(repeat_flights(&world, &drawn, repeats, system.policy.decider().as_mut())?)
                })
            };
            detail.fading.push((kind, fly("regular", Fading::None)?, fly("fading", Fading::Rayleigh)?));
        }
        let example = self.example(ScenarioKind::ReachDestination)?;
        for preference in [Preference::DATA, Preference::ENERGY] {
            let what = format!("attention, example {}, w = {}", self.arguments.example, preference.w_data());
            let gaze = self.part(&name, &identity, &what, || {
                let mut drawn = self.draw(Setting::trained(ScenarioKind::ReachDestination))?;
                let place = drawn.iter().position(|(seed, _)| seed.number() == self.arguments.example);
                let place = place.unwrap_or_else(|| {
                    drawn.push(example.clone());
                    drawn.len() - 1
                });
                Ok(watch(self.site.world(), &drawn, place, preference, system.policy.decider().as_mut())?)
            })?;
            detail.gazes.extend(gaze);
        }
        for kind in ScenarioKind::ALL {
            let example = self.example(kind)?;
            let what = format!("trajectories, example {}, {kind}", self.arguments.example);
            let tracks = self.part(&name, &identity, &what, || {
                let preferences = [1.0, 0.5, 0.0].into_iter().filter_map(Preference::new);
                preferences
                    .map(|preference| {
                        Ok(track(self.site.world(), &example, preference, system.policy.decider().as_mut())?)
                    })
                    .collect()
            })?;
            detail.tracks.push((kind, tracks));
        }
        Ok(detail)
    }

    fn example(&self, kind: ScenarioKind) -> Result<(Seed, Realization)> {
        let seed = Seed::evaluation(self.arguments.example);
        Ok((seed, self.site.realization(&self.site.scenario(kind), seed)?))
    }
}

fn name(setting: Setting) -> String {
    format!("{}, K = {}, B = {}", setting.scenario_name(), setting.devices, setting.battery)
}

/// The oracle on the realizations of the report, so that means are over the same missions. Settings with fewer
/// realizations are left out.
fn same_realizations(lines: &[OracleSetting], count: u64) -> Vec<OracleSetting> {
    lines.iter().filter_map(|line| line.first(count)).collect()
}

/// The command line of this program.
fn command_line() -> String {
    let words =
        std::env::args().skip(1).map(|word| if word.contains(' ') { format!("'{word}'") } else { word });
    format!("gleaner-train {}", words.collect::<Vec<_>>().join(" "))
}

/// The processor, for the inference times.
fn machine() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    model
        .map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| format!("{}, one thread", name.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_host_trainer::judge::evaluation::Missions;

    #[test]
    fn oracle_is_cut_to_the_realizations_of_the_report() {
        let line = |realizations: u64| OracleSetting {
            scenario: "rd".into(),
            devices: 6,
            battery: 80,
            realizations,
            missions: Missions(vec![(0..realizations).map(|i| [i as f32, -32.0]).collect(); 11]),
            upper_bound_percent: vec![99.0; realizations as usize],
            bound_parts: 0,
        };
        let cut = same_realizations(&[line(100), line(3)], 5);
        assert_eq!(cut.len(), 1, "a setting with 3 of 5 realizations does not compare");
        assert_eq!(cut[0].missions.realizations(), 5);
        assert_eq!(cut[0].missions.table().coverage(), 2.0);
        assert_eq!(cut[0].upper_bound_percent.len(), 5);
    }
}
