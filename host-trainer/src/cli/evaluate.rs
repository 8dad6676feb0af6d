//! `gleaner-train evaluate`.

use super::oracle::{bar, plan, prove};
use anyhow::{Context, Result, bail};
use gleaner_host_trainer::evaluation::{
    Engine, Missions, Table, fly_all, fly_greedy, realizations, test_preferences,
};
use gleaner_host_trainer::oracle::Thoroughness;
use gleaner_host_trainer::planner::{DEVICES_MAX, Rates};
use gleaner_host_trainer::train::Learned;
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
    /// The oracle too, with so many tours for each search; 20,000 take less than a second per mission.
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
    let mut bounds = Vec::new();
    if let Some(tours) = arguments.oracle {
        let table = over(&places, |world, drawn| {
            let rates = Rates::new(Arc::clone(world));
            let planned = plan(&rates, drawn, Thoroughness { tours }, &bar(drawn, "oracle".into()));
            if let Some(parts) = arguments.bound {
                let bar = bar(drawn, "proven bound".into());
                bounds.extend(prove(&rates, drawn, &planned, parts, &bar));
            }
            Ok(planned)
        })?;
        systems.push(("oracle".to_owned(), table));
    }
    let bound = (!bounds.is_empty()).then(|| bounds.iter().sum::<f32>() / bounds.len() as f32);
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
    if arguments.json {
        let mut object: serde_json::Map<_, _> = systems
            .into_iter()
            .map(|(name, table)| Ok((name, serde_json::to_value(table)?)))
            .collect::<Result<_>>()?;
        if let Some(percent) = bound {
            object.insert("proven bound".to_owned(), serde_json::json!({ "data_percent": percent }));
        }
        println!("{}", serde_json::Value::Object(object));
    } else {
        let cities =
            arguments.cities.map_or(String::new(), |count| format!(" in each of {count} generated cities"));
        println!(
            "{}, K = {}, B = {}, {} realizations{cities}",
            arguments.scenario, arguments.devices, arguments.battery, arguments.realizations
        );
        for (name, table) in &systems {
            println!("\n{name}\n{}", render(table));
        }
        if let Some(percent) = bound {
            println!("\nproven bound: nobody can have more than {percent:.1} % of the data in the mean");
        }
    }
    Ok(())
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
