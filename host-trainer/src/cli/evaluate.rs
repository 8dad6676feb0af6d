//! `gleaner-train evaluate`.

use super::mismatch::MismatchArguments;
use super::oracle::{bar, known, plan, prove, read_or_shipped};
use super::site::SiteArguments;
use super::{model, snapshot_in};
use anyhow::{Result, bail};
use gleaner_host_trainer::env::mismatch::{MapError, Mismatch};
use gleaner_host_trainer::env::site::Site;
use gleaner_host_trainer::judge::evaluation::{
    Decider, Engine, Missions, Table, fly_all_as, fly_greedy, test_preferences,
};
use gleaner_host_trainer::judge::lookahead::LookingAhead;
use gleaner_host_trainer::judge::paper::Setting;
use gleaner_host_trainer::planner::oracle::Thoroughness;
use gleaner_host_trainer::planner::{DEVICES_MAX, Rates};
use gleaner_lookahead::Budget;
use gleaner_units::BatteryUnits;
use gleaner_world::{City, Realization, ScenarioKind, Seed, World};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// An ONNX model, in the engine that flies it on board.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The folder of a run: its best parameters; FOLDER/last has the last ones.
    #[arg(long, value_name = "FOLDER")]
    run: Option<PathBuf>,
    /// `rd` reaches a destination, `rb` returns to base.
    #[arg(long, value_parser = super::scenario::parse, default_value = "rd")]
    scenario: ScenarioKind,
    /// Number of devices, K [default: 6, or those of --mission].
    #[arg(long, conflicts_with = "mission")]
    devices: Option<usize>,
    /// Battery units at the start, B [default: 80, or that of --mission].
    #[arg(long)]
    battery: Option<u16>,
    /// Evaluation realizations, numbers 0 to N - 1, in each city.
    #[arg(long, default_value_t = 100)]
    realizations: u64,
    /// Fly over this many generated cities, numbers 0 to N - 1, which no policy was trained in, instead of the default
    /// city.
    #[arg(long, conflicts_with_all = ["city", "mission"])]
    cities: Option<u64>,
    /// Run the oracle, with this many tours per search; 20,000 take less than a second per mission. Without it, oracle
    /// and proven bound come from `models/oracle.jsonl` where that file has these missions.
    #[arg(long, value_name = "TOURS")]
    oracle: Option<u32>,
    /// Prove an upper bound of the collected data, with this many nodes of the search tree; 2000 take some seconds per
    /// mission.
    #[arg(long, value_name = "PARTS", requires = "oracle")]
    bound: Option<u32>,
    /// Also fly the model with look-ahead, with this many tours per decision; 1000 take some milliseconds. With
    /// `--no-map` the network decides alone.
    #[arg(long, value_name = "TOURS", requires = "model")]
    lookahead: Option<u32>,
    /// Print one JSON object instead of tables.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    site: SiteArguments,
    #[command(flatten)]
    mismatch: MismatchArguments,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    check(arguments)?;
    let places = places(arguments)?;
    let mut systems = vec![("GREEDY".to_owned(), over(&places, Place::fly_greedy)?)];
    if let Some(folder) = &arguments.run {
        let (system, snapshot) = snapshot_in(folder)?;
        let mut policy = system.policy(&snapshot);
        let table = over(&places, |place| place.fly(&mut *policy))?;
        systems.push((format!("{}", folder.display()), table));
    }
    if let Some(path) = &arguments.model {
        let mut policy = model::load(path)?;
        let table = over(&places, |place| place.fly(&mut Engine(&mut policy)))?;
        systems.push((format!("{}", path.display()), table));
        if let Some(tours) = arguments.lookahead {
            let has_map = arguments.mismatch.mismatch().map != MapError::Flat;
            let table = over(&places, |place| {
                place.fly(&mut LookingAhead::new(&mut policy, Budget { tours }).with_map(has_map))
            })?;
            systems.push((format!("{} with look-ahead", path.display()), table));
        }
    }
    let References { oracle, bound_percent } = references(arguments, &places)?;
    let summary = summary(&systems, oracle.as_ref(), bound_percent);
    systems.extend(oracle.map(|oracle| (ORACLE.to_owned(), oracle)));
    if arguments.json {
        return print_json(systems, bound_percent);
    }
    println!("{}\n\n{summary}", heading(arguments, &places));
    for (name, table) in &systems {
        println!("\n## {name}\n\n{}", render(table));
    }
    Ok(())
}

fn check(arguments: &Arguments) -> Result<()> {
    if arguments.realizations == 0 {
        bail!("--realizations 0: no mission to fly; give at least 1");
    }
    if arguments.devices == Some(0) {
        bail!("--devices 0: a mission without devices has no data to measure; give at least 1");
    }
    if arguments.cities == Some(0) {
        bail!("--cities 0: no city to fly over; give at least 1, or leave it out for the default city");
    }
    if let Some(devices) = arguments.devices.filter(|&devices| devices > DEVICES_MAX)
        && arguments.oracle.is_some()
    {
        bail!("--devices {devices}: the oracle plans for at most {DEVICES_MAX}; leave out --oracle");
    }
    Ok(())
}

fn print_json(systems: Vec<(String, Table)>, bound_percent: Option<f32>) -> Result<()> {
    let mut object: serde_json::Map<_, _> = systems
        .into_iter()
        .map(|(name, table)| Ok((name, serde_json::to_value(table)?)))
        .collect::<Result<_>>()?;
    if let Some(percent) = bound_percent {
        object.insert(BOUND.to_owned(), serde_json::json!({ "data_percent": percent }));
    }
    println!("{}", serde_json::Value::Object(object));
    Ok(())
}

/// Scenario, numbers, place and mismatch in one line.
fn heading(arguments: &Arguments, places: &[Place]) -> String {
    let first = places.first().and_then(|place| place.drawn.first());
    let (devices, battery) =
        first.map_or((0, 0.0), |(_, realization)| (realization.devices().len(), realization.battery().0));
    let mut text = format!(
        "{}, K = {devices}, B = {battery}, {} realizations",
        arguments.scenario, arguments.realizations
    );
    if let Some(count) = arguments.cities {
        let _ = write!(text, " in each of {count} generated cities");
    }
    for path in [&arguments.site.city, &arguments.site.mission].into_iter().flatten() {
        let _ = write!(text, ", {}", path.display());
    }
    text + &arguments.mismatch.to_string()
}

const ORACLE: &str = "oracle";
const BOUND: &str = "proven bound";

/// What the systems are measured against, as far as it is known.
#[derive(Default)]
struct References {
    oracle: Option<Table>,
    /// Upper bound of the data at w = (1, 0), percent, mean over the missions.
    bound_percent: Option<f32>,
}

/// Runs oracle and bound if requested, else takes them from the shipped file if it has these missions.
fn references(arguments: &Arguments, places: &[Place]) -> Result<References> {
    let Some(tours) = arguments.oracle else {
        let is_nominal = arguments.cities.is_none()
            && arguments.site.is_default()
            && arguments.mismatch.channel_is_nominal();
        if !is_nominal {
            return Ok(References::default());
        }
        let setting = Setting {
            kind: arguments.scenario,
            devices: arguments.devices.unwrap_or(6),
            battery: arguments.battery.unwrap_or(80),
        };
        let known = known(&read_or_shipped(None)?, setting, arguments.realizations);
        return Ok(known.map_or_else(References::default, |known| References {
            bound_percent: known.limits(setting).map(|limits| limits.data_percent),
            oracle: Some(known.missions.table()),
        }));
    };
    let mut bounds = Vec::new();
    let oracle = over(places, |Place { world, drawn, .. }| {
        let rates = Rates::new(Arc::clone(world));
        let planned = plan(&rates, drawn, Thoroughness { tours }, &bar(drawn, ORACLE.into()));
        if let Some(parts) = arguments.bound {
            bounds.extend(prove(&rates, drawn, &planned, parts, &bar(drawn, BOUND.into())));
        }
        Ok(planned)
    })?;
    let bound_percent = (!bounds.is_empty()).then(|| bounds.iter().sum::<f32>() / bounds.len() as f32);
    Ok(References { oracle: Some(oracle), bound_percent })
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

/// A world, the missions to fly in it, and what the policy knows of it.
struct Place {
    world: Arc<World>,
    drawn: Vec<(Seed, Realization)>,
    mismatch: Mismatch,
    /// The map on board, if it is not the true one.
    map: Option<Arc<City>>,
}

impl Place {
    fn fly(&self, policy: &mut dyn Decider) -> Result<Missions> {
        let prepare = |flight, seed| self.mismatch.prepare(flight, self.map.as_ref(), seed);
        Ok(fly_all_as(&self.world, &self.drawn, &test_preferences(), policy, prepare)?)
    }

    fn fly_greedy(&self) -> Result<Missions> {
        Ok(fly_greedy(&self.world, &self.drawn))
    }
}

fn places(arguments: &Arguments) -> Result<Vec<Place>> {
    let sites = match arguments.cities {
        None => vec![arguments.site.site()?],
        Some(count) => {
            let channel = gleaner_world::Channel::default();
            (0..count)
                .map(|number| Site::new(Arc::new(World::new(City::generate(number), channel))))
                .collect()
        }
    };
    sites.iter().map(|site| place(arguments, site)).collect()
}

fn place(arguments: &Arguments, site: &Site) -> Result<Place> {
    let mismatch = arguments.mismatch.mismatch();
    let city = site.world().city();
    let site = site.in_world(Arc::new(mismatch.world(city.clone())));
    let mut scenario = site.scenario(arguments.scenario);
    if let Some(devices) = arguments.devices {
        scenario = scenario.with_devices(devices);
    }
    if let Some(battery) = arguments.battery {
        scenario = scenario.with_battery(BatteryUnits(f32::from(battery)));
    }
    let drawn = (0..arguments.realizations).map(|number| {
        let seed = Seed::evaluation(number);
        Ok((seed, site.realization(&scenario, seed)?))
    });
    Ok(Place {
        drawn: drawn.collect::<Result<_>>()?,
        // One seed: every system gets the same wrong map.
        map: mismatch.map(city, Seed::evaluation(0)),
        mismatch,
        world: Arc::clone(site.world()),
    })
}

/// One table over all places. GREEDY chooses its parameter in each place.
fn over(places: &[Place], mut fly: impl FnMut(&Place) -> Result<Missions>) -> Result<Table> {
    let mut all = Missions(vec![Vec::new(); test_preferences().len()]);
    for place in places {
        for (all, missions) in all.0.iter_mut().zip(fly(place)?.0) {
            all.extend(missions);
        }
    }
    Ok(all.table())
}

/// The table as Markdown, for the console and for model cards.
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
