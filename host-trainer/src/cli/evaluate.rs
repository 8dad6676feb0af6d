//! `gleaner-train evaluate`.

use super::oracle::{bar, known, plan, prove, read_or_shipped};
use anyhow::{Context, Result, bail};
use gleaner_host_trainer::judge::evaluation::{
    Engine, Missions, Table, fly_all, fly_greedy, realizations, test_preferences,
};
use gleaner_host_trainer::judge::paper::Setting;
use gleaner_host_trainer::learn::run::Learned;
use gleaner_host_trainer::planner::oracle::Thoroughness;
use gleaner_host_trainer::planner::{DEVICES_MAX, Rates};
use gleaner_units::BatteryUnits;
use gleaner_world::{Channel, City, Realization, ScenarioKind, Seed, World};
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// An ONNX model, flown by the engine that flies it on board.
    #[arg(long)]
    model: Option<PathBuf>,
    /// The folder of a run: its best parameters, flown by the learner's network.
    #[arg(long)]
    run: Option<PathBuf>,
    /// `rd` reaches a destination, `rb` returns to base.
    #[arg(long, default_value = "rd")]
    scenario: ScenarioKind,
    /// Number of devices, K.
    #[arg(long, default_value_t = 6)]
    devices: usize,
    /// Battery units at the start, B.
    #[arg(long, default_value_t = 80)]
    battery: u16,
    /// Evaluation realizations, numbers 0 to N - 1, in each city.
    #[arg(long, default_value_t = 100)]
    realizations: u64,
    /// Fly over so many generated cities, numbers 0 to N - 1, in which nothing was ever trained, instead of the default
    /// one.
    #[arg(long)]
    cities: Option<u64>,
    /// Ask the oracle, with so many tours for each search; 20,000 take less than a second per mission. Left out, it and
    /// the proven bound are those of `models/oracle.jsonl` where that has these missions.
    #[arg(long, value_name = "TOURS")]
    oracle: Option<u32>,
    /// Prove how much of the data can be had at most, looking at so many parts of each mission's possibilities; 2000 take
    /// some seconds per mission.
    #[arg(long, value_name = "PARTS", requires = "oracle")]
    bound: Option<u32>,
    /// One JSON object instead of tables.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.realizations == 0 {
        bail!("--realizations 0: nothing to fly; give at least 1");
    }
    if arguments.cities == Some(0) {
        bail!("--cities 0: nowhere to fly; give at least 1, or leave it out for the default city");
    }
    if arguments.oracle.is_some() && arguments.devices > DEVICES_MAX {
        bail!(
            "--devices {}: the oracle plans for at most {DEVICES_MAX}; leave out --oracle",
            arguments.devices
        );
    }
    let places = places(arguments)?;
    let mut systems =
        vec![("GREEDY".to_owned(), over(&places, |world, drawn| Ok(fly_greedy(world, drawn)))?)];
    if let Some(folder) = &arguments.run {
        let learned = learned(folder)?;
        let mut decider = learned.decider();
        let table =
            over(&places, |world, drawn| Ok(fly_all(world, drawn, &test_preferences(), &mut *decider)?))?;
        systems.push((format!("{}", folder.display()), table));
    }
    if let Some(path) = &arguments.model {
        let mut policy = super::export::load_model(path)?;
        let table = over(&places, |world, drawn| {
            Ok(fly_all(world, drawn, &test_preferences(), &mut Engine(&mut policy))?)
        })?;
        systems.push((format!("{}", path.display()), table));
    }
    let Limits { oracle, data_percent } = limits(arguments, &places)?;
    let summary = summary(&systems, oracle.as_ref(), data_percent);
    systems.extend(oracle.map(|oracle| (ORACLE.to_owned(), oracle)));
    if arguments.json {
        let mut object: serde_json::Map<_, _> = systems
            .into_iter()
            .map(|(name, table)| Ok((name, serde_json::to_value(table)?)))
            .collect::<Result<_>>()?;
        if let Some(percent) = data_percent {
            object.insert(BOUND.to_owned(), serde_json::json!({ "data_percent": percent }));
        }
        println!("{}", serde_json::Value::Object(object));
    } else {
        let cities =
            arguments.cities.map_or(String::new(), |count| format!(" in each of {count} generated cities"));
        println!(
            "{}, K = {}, B = {}, {} realizations{cities}\n\n{summary}",
            arguments.scenario, arguments.devices, arguments.battery, arguments.realizations
        );
        for (name, table) in &systems {
            println!("\n## {name}\n\n{}", render(table));
        }
    }
    Ok(())
}

const ORACLE: &str = "oracle";
const BOUND: &str = "proven bound";

/// What systems are measured against, as far as it is known.
#[derive(Default)]
struct Limits {
    oracle: Option<Table>,
    /// Percent of the data at w = (1, 0) that nobody can exceed in the mean.
    data_percent: Option<f32>,
}

/// Plans and proves what is asked for; else what is shipped has it, if it has these missions.
fn limits(arguments: &Arguments, places: &[Place]) -> Result<Limits> {
    let Some(tours) = arguments.oracle else {
        if arguments.cities.is_some() {
            return Ok(Limits::default());
        }
        let setting =
            Setting { kind: arguments.scenario, devices: arguments.devices, battery: arguments.battery };
        let known = known(&read_or_shipped(None)?, setting, arguments.realizations);
        return Ok(known.map_or_else(Limits::default, |known| Limits {
            data_percent: known.limits(setting).map(|limits| limits.data_percent),
            oracle: Some(known.missions.table()),
        }));
    };
    let mut bounds = Vec::new();
    let oracle = over(places, |world, drawn| {
        let rates = Rates::new(Arc::clone(world));
        let planned = plan(&rates, drawn, Thoroughness { tours }, &bar(drawn, ORACLE.into()));
        if let Some(parts) = arguments.bound {
            bounds.extend(prove(&rates, drawn, &planned, parts, &bar(drawn, BOUND.into())));
        }
        Ok(planned)
    })?;
    let data_percent = (!bounds.is_empty()).then(|| bounds.iter().sum::<f32>() / bounds.len() as f32);
    Ok(Limits { oracle: Some(oracle), data_percent })
}

/// All systems in one Markdown table, with their share of what the oracle reaches.
fn summary(systems: &[(String, Table)], oracle: Option<&Table>, bound: Option<f32>) -> String {
    let mut text = String::from(
        "| | data % at w = (1, 0) | of the oracle's | battery at w = (0, 1) | hypervolume | of the oracle's \
         | average utility |\n|---|---|---|---|---|---|---|\n",
    );
    let share = |own: f64, oracle: Option<f64>| {
        oracle.map_or_else(|| "-".to_owned(), |oracle| format!("{:.1} %", 100.0 * own / oracle))
    };
    for (name, table) in
        systems.iter().map(|(name, table)| (name.as_str(), table)).chain(oracle.map(|o| (ORACLE, o)))
    {
        let energy = table.rows.first().map_or((0.0, 0.0), |row| (row.energy, row.energy_std));
        text += &format!(
            "| {name} | {:.1} | {} | {:.2} ± {:.2} | {:.0} | {} | {:.2} |\n",
            table.coverage(),
            share(table.coverage().into(), oracle.map(|oracle| oracle.coverage().into())),
            energy.0,
            energy.1,
            table.hypervolume,
            share(table.hypervolume, oracle.map(|oracle| oracle.hypervolume)),
            table.utility,
        );
    }
    if let Some(percent) = bound {
        let share = share(percent.into(), oracle.map(|oracle| oracle.coverage().into()));
        text += &format!("| {BOUND} | {percent:.1} | {share} | - | - | - | - |\n");
    }
    text
}

/// A city, and the missions to fly over it.
type Place = (Arc<World>, Vec<(Seed, Realization)>);

fn places(arguments: &Arguments) -> Result<Vec<Place>> {
    let scenario = arguments
        .scenario
        .scenario()
        .with_devices(arguments.devices)
        .with_battery(BatteryUnits(f32::from(arguments.battery)));
    let worlds = match arguments.cities {
        None => vec![World::default_world()],
        Some(count) => {
            (0..count).map(|number| World::new(City::generate(number), Channel::default())).collect()
        }
    };
    worlds
        .into_iter()
        .map(|world| {
            let drawn = realizations(&world, &scenario.in_city(world.city()), arguments.realizations)?;
            Ok((Arc::new(world), drawn))
        })
        .collect()
}

/// One table over all places. GREEDY may choose its parameterisation anew in each.
fn over(
    places: &[Place],
    mut fly: impl FnMut(&Arc<World>, &[(Seed, Realization)]) -> Result<Missions>,
) -> Result<Table> {
    let mut all = Missions(vec![Vec::new(); test_preferences().len()]);
    for (world, drawn) in places {
        for (all, missions) in all.0.iter_mut().zip(fly(world, drawn)?.0) {
            all.extend(missions);
        }
    }
    Ok(all.table())
}

/// The best parameters of the run in `folder`.
pub fn learned(folder: &Path) -> Result<Learned> {
    Learned::load(folder)?.with_context(|| {
        format!(
            "{}: no run has been validated here yet; wait for its first line or check --run",
            folder.display()
        )
    })
}

/// The table as Markdown, for people and for model cards.
pub fn render(table: &Table) -> String {
    let mut text = String::from("| w_data | data % | energy | energy std |\n|---|---|---|---|\n");
    for row in &table.rows {
        text += &format!(
            "| {:.1} | {:.1} | {:.2} | {:.2} |\n",
            row.w_data, row.data_percent, row.energy, row.energy_std
        );
    }
    text + &format!("\nhypervolume {:.0}, average utility {:.2}", table.hypervolume, table.utility)
}
