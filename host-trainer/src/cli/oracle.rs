//! `gleaner-train oracle`.

use anyhow::{Context, Result, bail};
use gleaner_host_trainer::evaluation::{Missions, realizations, test_preferences};
use gleaner_host_trainer::oracle::{OracleSetting, Thoroughness, consult};
use gleaner_host_trainer::paper::Setting;
use gleaner_host_trainer::planner::Rates;
use gleaner_world::World;
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The file that the results are added to, one JSON object a line; settings that it has are not done again.
    #[arg(long)]
    out: PathBuf,
    /// Evaluation realizations, numbers 0 to N - 1.
    #[arg(long, default_value_t = 100)]
    realizations: u64,
    /// Tours that are tried per mission and preference, twice.
    #[arg(long, default_value_t = 100_000)]
    tours: u32,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.realizations == 0 || arguments.tours == 0 {
        bail!("nothing to do: give at least one of --realizations and --tours");
    }
    let at = || arguments.out.display().to_string();
    let done = read(arguments)?;
    let mut file = OpenOptions::new().create(true).append(true).open(&arguments.out).with_context(at)?;
    let world = Arc::new(World::default_world());
    let rates = Rates::new(Arc::clone(&world));
    for asked in Setting::ALL {
        let Setting { kind, devices, battery } = asked;
        let is_done = done.iter().any(|setting| {
            (setting.scenario.as_str(), setting.devices, setting.battery, setting.realizations)
                == (kind.name(), devices, battery, arguments.realizations)
        });
        if is_done {
            println!("{kind} K={devices} B={battery}: in {} already", arguments.out.display());
            continue;
        }
        let mut setting = OracleSetting {
            scenario: kind.name().to_owned(),
            devices,
            battery,
            realizations: arguments.realizations,
            missions: Missions(vec![Vec::new(); test_preferences().len()]),
            upper_bound_percent: Vec::new(),
        };
        let bar = bar(arguments.realizations, format!("{kind} K={devices} B={battery}"));
        for (_, realization) in realizations(&world, &asked.scenario(), arguments.realizations)? {
            let thoroughness = Thoroughness { tours: arguments.tours };
            let rewards = consult(&rates, &realization, thoroughness);
            for (list, reward) in setting.missions.0.iter_mut().zip(rewards) {
                list.push(reward);
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        writeln!(file, "{}", serde_json::to_string(&setting)?).with_context(at)?;
        println!("{}", summary(&setting));
    }
    Ok(())
}

/// What the file has already. A line that a kill cut short is left out.
fn read(arguments: &Arguments) -> Result<Vec<OracleSetting>> {
    if !arguments.out.exists() {
        return Ok(Vec::new());
    }
    let at = || arguments.out.display().to_string();
    let mut settings = Vec::new();
    for line in BufReader::new(File::open(&arguments.out).with_context(at)?).lines() {
        if let Ok(setting) = serde_json::from_str(&line.with_context(at)?) {
            settings.push(setting);
        }
    }
    Ok(settings)
}

fn summary(setting: &OracleSetting) -> String {
    let mean = |values: &mut dyn Iterator<Item = f32>| {
        let (count, sum) = values.fold((0, 0.0), |(count, sum), value| (count + 1, sum + value));
        sum / count.max(1) as f32
    };
    let data = |index: usize| mean(&mut setting.missions.0[index].iter().map(|reward| reward[0]));
    let energy = |index: usize| -mean(&mut setting.missions.0[index].iter().map(|reward| reward[1]));
    format!(
        "{} K={} B={}: {:.1} % of the data for {:.1} units; least energy {:.2}",
        setting.scenario,
        setting.devices,
        setting.battery,
        data(setting.missions.0.len() - 1),
        energy(setting.missions.0.len() - 1),
        energy(0),
    )
}

fn bar(count: u64, name: String) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {bar:30} {pos}/{len} missions, {eta} left");
    let bar = ProgressBar::new(count).with_message(name);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
