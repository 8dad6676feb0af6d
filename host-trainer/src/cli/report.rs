//! `gleaner-train report`.

use super::systems::System;
use super::{oracle, write_whole};
use anyhow::{Result, bail};
use gleaner_host_trainer::judge::evaluation::{fly_all, fly_greedy, realizations, test_preferences};
use gleaner_host_trainer::judge::explanation::{track, watch};
use gleaner_host_trainer::judge::paper::Setting;
use gleaner_host_trainer::judge::robustness::{repeat_flights, world_with};
use gleaner_host_trainer::keep::curves;
use gleaner_host_trainer::keep::parts::{Parts, Source};
use gleaner_host_trainer::report::{self, Detail, Report};
use gleaner_host_trainer::systems::System as Learner;
use gleaner_policy::Preference;
use gleaner_world::{Fading, Realization, ScenarioKind, Seed, World};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is reported on when nothing is named: the model, and a folder for each of the paper's systems.
const SHIPPED: &str = "models/gleaner.onnx";
const SHIPPED_RUNS: &str = "models/paper";

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// An ONNX model, flown by the engine that flies it on board; NAME=FILE gives it a name. Repeatable. The first
    /// system of all is looked at more closely: fading, attention, trajectories. Without any --model and --run: all
    /// that is shipped in models/.
    #[arg(long, value_name = "[NAME=]FILE")]
    model: Vec<String>,
    /// The folder of a run: its best parameters, flown by the learner's network, and its learning curve; NAME=FOLDER
    /// gives it a name. Repeatable.
    #[arg(long, value_name = "[NAME=]FOLDER")]
    run: Vec<String>,
    /// The folder of a run of which only the learning curve is shown, such as the one that made a model. Repeatable.
    #[arg(long, value_name = "[NAME=]FOLDER")]
    curve: Vec<String>,
    /// What `gleaner-train oracle` wrote: the oracle for every table. The default is the shipped one.
    #[arg(long, value_name = "FILE")]
    oracle: Option<PathBuf>,
    /// Folder of the page, the CSV files and the finished parts.
    #[arg(long, default_value = "target/report")]
    out: PathBuf,
    /// Evaluation realizations per setting, numbers 0 to N - 1.
    #[arg(long, default_value_t = 100)]
    realizations: u64,
    /// Repeats of the fading test.
    #[arg(long, default_value_t = 30)]
    fading_repeats: u32,
    /// Evaluation realization that is drawn as an example.
    #[arg(long, default_value_t = 0)]
    example: u64,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.realizations == 0 {
        bail!("--realizations 0: nothing to fly; give at least 1");
    }
    let chosen = Chosen::by(arguments);
    let mut systems = chosen.systems()?;
    let oracle = oracle::read_or_shipped(arguments.oracle.as_deref())?;
    let curves = chosen.curves()?;
    let desk = Desk::open(arguments, systems.len())?;
    let mut shown = vec![desk.greedy()?];
    for system in &mut systems {
        shown.push(desk.evaluate(system)?);
    }
    let detail = systems.first_mut().map(|system| desk.look_closer(system)).transpose()?;
    desk.bar.finish_and_clear();
    let world = &desk.world;
    let report = Report {
        command: command_line(),
        machine: machine(),
        realizations: arguments.realizations,
        heights: world.city().heights().clone(),
        city_hash: world.city().fingerprint(),
        systems: shown,
        oracle,
        detail,
        curves,
    };
    for (name, text) in report::files(&report) {
        write_whole(&arguments.out.join(name), text.as_bytes())?;
    }
    let page = arguments.out.join("report.html");
    write_whole(&page, report::page(&report).as_bytes())?;
    println!("wrote {}, and the CSV files beside it", page.display());
    Ok(())
}

/// What measures and tells.
struct Desk<'a> {
    arguments: &'a Arguments,
    world: Arc<World>,
    parts: Parts,
    bar: ProgressBar,
}

impl<'a> Desk<'a> {
    fn open(arguments: &'a Arguments, systems: usize) -> Result<Desk<'a>> {
        let parts = Parts::open(&arguments.out.join("parts"))?;
        let closer = if systems == 0 { 0 } else { 4 + 2 + 2 };
        let bar = ProgressBar::new((Setting::ALL.len() * (systems + 1) + systems + closer) as u64);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} parts, {elapsed}, now {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Ok(Desk { arguments, world: Arc::new(World::default_world()), parts, bar })
    }

    /// One part: from the folder if it is there, and told in any case.
    fn part<T: Serialize + DeserializeOwned>(
        &self,
        system: &str,
        identity: &str,
        what: &str,
        measure: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        self.bar.set_message(format!("{system}: {what}"));
        let city = self.world.city().fingerprint();
        let count = self.arguments.realizations;
        let facts = format!("{identity}, {what}, {count} realizations, city {city:016x}");
        let (part, source) = self.parts.part(&facts, measure)?;
        self.bar.inc(1);
        match source {
            Source::Repaired => self.tell(&format!("{system}: {what}: damaged part, measured again")),
            Source::Measured if !std::io::stderr().is_terminal() => {
                self.tell(&format!("{system}: {what}: done"));
            }
            Source::Measured | Source::Kept => {}
        }
        Ok(part)
    }

    fn tell(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
    }

    fn draw(&self, setting: Setting) -> Result<Vec<(Seed, Realization)>> {
        Ok(realizations(&self.world, &setting.scenario(), self.arguments.realizations)?)
    }

    fn greedy(&self) -> Result<report::System> {
        let missions = Setting::ALL
            .iter()
            .map(|&setting| {
                self.part("GREEDY", "greedy", &name(setting), || {
                    Ok(fly_greedy(&self.world, &self.draw(setting)?))
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

    fn evaluate(&self, system: &mut System) -> Result<report::System> {
        let identity = system.identity.clone();
        let missions = Setting::ALL
            .iter()
            .map(|&setting| {
                self.part(&system.name, &identity, &name(setting), || {
                    let drawn = self.draw(setting)?;
                    let preferences = test_preferences();
                    Ok(fly_all(&self.world, &drawn, &preferences, system.engine.decider().as_mut())?)
                })
            })
            .collect::<Result<_>>()?;
        let facts = format!("{identity}, {}", machine());
        let latency =
            self.part(&system.name, &facts, "inference time", || system.engine.latency(&self.world))?;
        Ok(report::System {
            name: system.name.clone(),
            origin: system.origin.clone(),
            parameters: Some(system.engine.parameters()),
            latency: Some(latency),
            missions,
        })
    }

    /// What only the first learned system is put through: the paper does it with MOSAC-ATT alone.
    fn look_closer(&self, system: &mut System) -> Result<Detail> {
        let (name, identity) = (system.name.clone(), system.identity.clone());
        let mut detail = Detail {
            system: name.clone(),
            fading: Vec::new(),
            gazes: Vec::new(),
            tracks: Vec::new(),
            example: self.arguments.example,
        };
        let repeats = self.arguments.fading_repeats;
        for kind in ScenarioKind::ALL {
            let drawn = self.draw(Setting::trained(kind))?;
            let mut fly = |what: &str, fading| {
                let what = format!("{what} channel, {repeats} repeats, {kind}");
                self.part(&name, &identity, &what, || {
                    let world = world_with(self.world.city().clone(), fading);
                    Ok(repeat_flights(&world, &drawn, repeats, system.engine.decider().as_mut())?)
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
                Ok(watch(&self.world, &drawn, place, preference, system.engine.decider().as_mut())?)
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
                        Ok(track(&self.world, &example, preference, system.engine.decider().as_mut())?)
                    })
                    .collect()
            })?;
            detail.tracks.push((kind, tracks));
        }
        Ok(detail)
    }

    fn example(&self, kind: ScenarioKind) -> Result<(Seed, Realization)> {
        let seed = Seed::evaluation(self.arguments.example);
        Ok((seed, Realization::draw(self.world.city(), &kind.scenario(), seed)?))
    }
}

fn name(setting: Setting) -> String {
    format!("{}, K = {}, B = {}", setting.scenario_name(), setting.devices, setting.battery)
}

/// A name, if it was given one, and where it lies.
type Named = (Option<String>, PathBuf);

/// What is reported on.
struct Chosen {
    models: Vec<Named>,
    runs: Vec<Named>,
    curves: Vec<Named>,
}

impl Chosen {
    fn by(arguments: &Arguments) -> Chosen {
        let named = |list: &[String]| list.iter().map(|argument| named(argument)).collect();
        let mut chosen = Chosen {
            models: named(&arguments.model),
            runs: named(&arguments.run),
            curves: named(&arguments.curve),
        };
        if chosen.models.is_empty() && chosen.runs.is_empty() {
            let runs = Learner::ALL
                .map(|system| (Some(system.title().to_owned()), Path::new(SHIPPED_RUNS).join(system.name())));
            chosen.models.push((None, SHIPPED.into()));
            chosen.runs.extend(runs.into_iter().filter(|(_, folder)| folder.is_dir()));
        }
        chosen
    }

    fn systems(&self) -> Result<Vec<System>> {
        let mut systems = Vec::new();
        for (name, path) in &self.models {
            systems.push(System::model(name.as_deref(), path)?);
        }
        for (name, folder) in &self.runs {
            systems.push(System::run(name.as_deref(), folder)?);
        }
        for (index, system) in systems.iter().enumerate() {
            if systems[..index].iter().any(|other| other.name == system.name) {
                bail!("two systems are called {}; tell them apart with --model NAME=FILE", system.name);
            }
        }
        Ok(systems)
    }

    /// The learning curves; a run may have none yet, what was asked for its curve may not.
    fn curves(&self) -> Result<Vec<(String, Vec<curves::Point>)>> {
        let of = |(name, folder): &Named| -> Result<(String, Vec<curves::Point>)> {
            if !folder.is_dir() {
                bail!("{}: no such folder; check --run and --curve", folder.display());
            }
            let fallback = || folder.file_name().unwrap_or(folder.as_os_str()).display().to_string();
            Ok((name.clone().unwrap_or_else(fallback), curves::read(folder)?))
        };
        let mut all = self.runs.iter().map(of).collect::<Result<Vec<_>>>()?;
        for named in &self.curves {
            let curve = of(named)?;
            if curve.1.is_empty() {
                let folder = named.1.display();
                bail!("{folder}: no learning curve here yet; wait for its first line or check --curve");
            }
            all.push(curve);
        }
        Ok(all)
    }
}

/// `NAME=PATH`, or a path alone.
fn named(argument: &str) -> Named {
    match argument.split_once('=') {
        Some((name, path)) => (Some(name.to_owned()), path.into()),
        None => (None, argument.into()),
    }
}

/// As it was typed.
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
