//! `gleaner-train evaluate`.

use anyhow::{Context, Result, bail};
use gleaner_host_trainer::evaluation::{Engine, Table, evaluate, evaluate_greedy, realizations};
use gleaner_host_trainer::train::Learned;
use gleaner_units::BatteryUnits;
use gleaner_world::{ScenarioKind, World};
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
    /// Evaluation realizations, numbers 0 to N - 1.
    #[arg(long, default_value_t = 100)]
    realizations: u64,
    /// One JSON object instead of tables.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.realizations == 0 {
        bail!("--realizations 0: nothing to fly; give at least 1");
    }
    let world = Arc::new(World::default_world());
    let scenario = arguments
        .scenario
        .scenario()
        .with_devices(arguments.devices)
        .with_battery(BatteryUnits(f32::from(arguments.battery)));
    let drawn = realizations(&world, &scenario, arguments.realizations)?;
    let mut systems = vec![("GREEDY".to_owned(), evaluate_greedy(&world, &drawn))];
    if let Some(folder) = &arguments.run {
        let learned = learned(folder)?;
        let mut decider = learned.decider();
        systems.push((format!("{}", folder.display()), evaluate(&world, &drawn, &mut *decider)?));
    }
    if let Some(path) = &arguments.model {
        let mut policy = super::export::load_model(path)?;
        systems.push((format!("{}", path.display()), evaluate(&world, &drawn, &mut Engine(&mut policy))?));
    }
    if arguments.json {
        let object: serde_json::Map<_, _> = systems
            .into_iter()
            .map(|(name, table)| Ok((name, serde_json::to_value(table)?)))
            .collect::<Result<_>>()?;
        println!("{}", serde_json::Value::Object(object));
    } else {
        println!(
            "{}, K = {}, B = {}, {} realizations",
            arguments.scenario, arguments.devices, arguments.battery, arguments.realizations
        );
        for (name, table) in &systems {
            println!("\n{name}\n{}", render(table));
        }
    }
    Ok(())
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
