//! `gleaner-train oracle`.

use super::write_whole;
use anyhow::{Context, Result, bail};
use gleaner_host_trainer::env::flight::Reward;
use gleaner_host_trainer::judge::evaluation::{Missions, realizations, test_preferences};
use gleaner_host_trainer::judge::paper::Setting;
use gleaner_host_trainer::planner::oracle::{OracleSetting, Thoroughness, consult};
use gleaner_host_trainer::planner::{Rates, upper_bound_percent};
use gleaner_world::{Realization, Seed, World};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The file that is shipped.
const SHIPPED: &str = "models/oracle.jsonl";

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The file of the results, one JSON object per line. Settings that it has already are not computed again.
    #[arg(long)]
    out: PathBuf,
    /// Evaluation realizations, numbers 0 to N - 1.
    #[arg(long, default_value_t = 100)]
    realizations: u64,
    /// Tours per search; two searches per mission and preference.
    #[arg(long, default_value_t = 100_000)]
    tours: u32,
    /// Prove an upper bound of the collected data, with this many nodes of each mission's search tree; 2000 take seconds
    /// per mission. 0 proves no bound.
    #[arg(long, value_name = "PARTS", default_value_t = 0)]
    bound: u32,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.realizations == 0 || arguments.tours == 0 {
        bail!("--realizations and --tours must be at least 1");
    }
    let mut lines = if arguments.out.exists() { read(&arguments.out)? } else { Vec::new() };
    let world = Arc::new(World::default_world());
    let rates = Rates::new(Arc::clone(&world));
    for asked in Setting::ALL {
        let Setting { kind, devices, battery } = asked;
        let name = format!("{kind} K={devices} B={battery}");
        let drawn = realizations(&world, &asked.scenario(), arguments.realizations)?;
        let is_asked =
            |line: &OracleSetting| line.is_of(asked) && line.realizations == arguments.realizations;
        let index = match lines.iter().rposition(is_asked) {
            Some(index) => index,
            None => {
                let bar = bar(&drawn, format!("{name}, tours"));
                lines.push(OracleSetting {
                    scenario: kind.name().to_owned(),
                    devices,
                    battery,
                    realizations: arguments.realizations,
                    missions: plan(&rates, &drawn, Thoroughness { tours: arguments.tours }, &bar),
                    upper_bound_percent: Vec::new(),
                    bound_parts: 0,
                });
                write(&arguments.out, &lines)?;
                lines.len() - 1
            }
        };
        if lines[index].bound_parts < arguments.bound {
            let bar = bar(&drawn, format!("{name}, bound"));
            let bounds = prove(&rates, &drawn, &lines[index].missions, arguments.bound, &bar);
            lines[index].upper_bound_percent = bounds;
            lines[index].bound_parts = arguments.bound;
            write(&arguments.out, &lines)?;
        }
        println!("{}", summary(&lines[index]));
    }
    Ok(())
}

/// Reward of the best tours found, by preference and mission.
pub(super) fn plan(
    rates: &Rates,
    drawn: &[(Seed, Realization)],
    thoroughness: Thoroughness,
    bar: &ProgressBar,
) -> Missions {
    let rewards: Vec<Vec<Reward>> = drawn
        .par_iter()
        .map(|(_, realization)| {
            let rewards = consult(rates, realization, thoroughness);
            bar.inc(1);
            rewards
        })
        .collect();
    bar.finish_and_clear();
    let of_preference = |index: usize| rewards.iter().map(|rewards| rewards[index]).collect();
    Missions((0..test_preferences().len()).map(of_preference).collect())
}

/// Upper bound of the data, percent, by mission. `planned` is the lower bound.
pub(super) fn prove(
    rates: &Rates,
    drawn: &[(Seed, Realization)],
    planned: &Missions,
    parts: u32,
    bar: &ProgressBar,
) -> Vec<f32> {
    let reached = |index: usize| {
        let missions = planned.0.iter().filter_map(|missions| missions.get(index));
        missions.map(|reward| reward[0]).fold(0.0, f32::max)
    };
    let bounds = drawn
        .par_iter()
        .enumerate()
        .map(|(index, (_, realization))| {
            let percent = upper_bound_percent(rates, realization, reached(index), parts);
            bar.inc(1);
            percent
        })
        .collect();
    bar.finish_and_clear();
    bounds
}

/// The settings in the named file, or in the shipped one if it exists.
pub(super) fn read_or_shipped(named: Option<&Path>) -> Result<Vec<OracleSetting>> {
    let shipped = Path::new(SHIPPED);
    named.or_else(|| shipped.exists().then_some(shipped)).map_or_else(|| Ok(Vec::new()), read)
}

/// The first `realizations` of one setting, if the lines have them.
pub(super) fn known(lines: &[OracleSetting], setting: Setting, realizations: u64) -> Option<OracleSetting> {
    // A later line of the file replaces an earlier one.
    lines.iter().rev().filter(|line| line.is_of(setting)).find_map(|line| line.first(realizations))
}

/// The settings in a file of this command.
fn read(path: &Path) -> Result<Vec<OracleSetting>> {
    let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let parse = |(index, line): (usize, &str)| -> Result<OracleSetting> {
        let place =
            || format!("{}: line {} is not a line of `gleaner-train oracle`", path.display(), index + 1);
        let setting: OracleSetting = serde_json::from_str(line).with_context(place)?;
        if setting.missions.0.len() != test_preferences().len() {
            bail!("{}: line {}: not eleven preferences", path.display(), index + 1);
        }
        Ok(setting)
    };
    text.lines().enumerate().map(parse).collect()
}

fn write(path: &Path, settings: &[OracleSetting]) -> Result<()> {
    let mut text = String::new();
    for setting in settings {
        text += &serde_json::to_string(setting)?;
        text += "\n";
    }
    write_whole(path, text.as_bytes())
}

fn summary(setting: &OracleSetting) -> String {
    let mean = |values: &mut dyn Iterator<Item = f32>| {
        let (count, sum) = values.fold((0, 0.0), |(count, sum), value| (count + 1, sum + value));
        sum / count.max(1) as f32
    };
    let data = |index: usize| mean(&mut setting.missions.0[index].iter().map(|reward| reward[0]));
    let energy = |index: usize| -mean(&mut setting.missions.0[index].iter().map(|reward| reward[1]));
    let proven = match &setting.upper_bound_percent[..] {
        [] => String::new(),
        bounds => format!(", upper bound {:.1} %", mean(&mut bounds.iter().copied())),
    };
    format!(
        "{} K={} B={}: {:.1} % of the data for {:.1} units{proven}; least energy {:.2}",
        setting.scenario,
        setting.devices,
        setting.battery,
        data(setting.missions.0.len() - 1),
        energy(setting.missions.0.len() - 1),
        energy(0),
    )
}

/// A progress bar over missions.
pub(super) fn bar(drawn: &[(Seed, Realization)], name: String) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {bar:30} {pos}/{len} missions, {eta} left");
    let bar = ProgressBar::new(drawn.len() as u64).with_message(name);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
