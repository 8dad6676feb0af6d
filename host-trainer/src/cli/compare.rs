//! `gleaner-train compare`: the table of mismatches.

use super::oracle::{known, read_or_shipped};
use anyhow::{Context, Result};
use gleaner_host_trainer::judge::comparison::{Arena, HEADING, ROWS, Row};
use gleaner_host_trainer::judge::paper::Setting;
use gleaner_host_trainer::planner::Rates;
use gleaner_host_trainer::planner::oracle::{Thoroughness, consult};
use gleaner_lookahead::Budget;
use gleaner_policy::{Engine, EngineKind};
use gleaner_world::{Realization, ScenarioKind, Seed};
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// An ONNX model, flown in the native engine.
    #[arg(long, value_name = "FILE", default_value = "models/gleaner.onnx")]
    model: PathBuf,
    /// Evaluation realizations, numbers 0 to N - 1.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
    realizations: u64,
    /// Tours per decision of the look-ahead.
    #[arg(long, default_value_t = Budget::LINUX.tours)]
    tours: u32,
    /// Tours per search of the oracle; 0 leaves the oracle out. In a world whose channel is nominal it comes from
    /// `models/oracle.jsonl` where that file has these missions.
    #[arg(long, default_value_t = 20_000)]
    oracle: u32,
    /// Only these rows: nominal, noise+3, noise+6, noise-6, exponents+0.3, fading, reports-10%, buildings-10%,
    /// heights-10m, no-map.
    #[arg(long, value_name = "ROW", value_parser = row)]
    row: Vec<Row>,
    /// Only this scenario.
    #[arg(long, value_parser = super::scenario::parse)]
    scenario: Option<ScenarioKind>,
    /// Number of devices, K.
    #[arg(long, default_value_t = 6)]
    devices: usize,
    /// Battery units at the start, B.
    #[arg(long, default_value_t = 80)]
    battery: u16,
    /// Also print how long the network and the look-ahead take per decision, on standard error.
    #[arg(long)]
    times: bool,
    /// Print one JSON object a row, with the data of each mission.
    #[arg(long)]
    json: bool,
    /// Fly the nominal row at w = (0, 1) instead, and print how many missions use the least possible energy.
    #[arg(long, conflicts_with_all = ["row", "json", "times"])]
    shortest: bool,
}

fn row(name: &str) -> Result<Row, String> {
    let names = || ROWS.map(|row| row.name).join(", ");
    ROWS.into_iter().find(|row| row.name == name).ok_or_else(|| format!("use one of {}", names()))
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let place = || arguments.model.display().to_string();
    let bytes = std::fs::read(&arguments.model).with_context(place)?;
    let mut policy = Engine::load_checked(&bytes, EngineKind::Native).with_context(place)?;
    let budget = Budget { tours: arguments.tours };
    if arguments.shortest {
        return shortest(arguments, &mut policy, budget);
    }
    let rows = if arguments.row.is_empty() { ROWS.to_vec() } else { arguments.row.clone() };
    if !arguments.json {
        println!("{HEADING}");
    }
    for row in rows {
        for kind in ScenarioKind::ALL {
            if arguments.scenario.is_some_and(|only| only != kind) {
                continue;
            }
            let setting = Setting { kind, devices: arguments.devices, battery: arguments.battery };
            let arena = Arena::new(row, setting, arguments.realizations)?;
            let (mut compared, times) = arena.compare(&mut policy, budget)?;
            if arguments.times {
                let [network, lookahead] = times.map(median_and_p99);
                eprintln!("{} {kind}: network {network}; look-ahead {lookahead}", row.name);
            }
            compared.oracle = oracle(arguments, &arena, row, setting)?;
            if arguments.json {
                println!("{}", serde_json::to_string(&compared)?);
            } else {
                println!("{compared}");
            }
        }
    }
    Ok(())
}

/// Prints the energy of network and look-ahead at w = (0, 1).
fn shortest(arguments: &Arguments, policy: &mut Engine, budget: Budget) -> Result<()> {
    println!(
        "| scenario | | missions with the least energy | mean energy | most energy |\n|---|---|---|---|---|"
    );
    for kind in ScenarioKind::ALL {
        if arguments.scenario.is_some_and(|only| only != kind) {
            continue;
        }
        let setting = Setting { kind, devices: arguments.devices, battery: arguments.battery };
        let arena = Arena::new(ROWS[0], setting, arguments.realizations)?;
        let least = arena.least_energy();
        let flown = arena.energy(policy, budget)?;
        for (name, energy) in ["network", "look-ahead"].into_iter().zip(flown) {
            let shortest = energy.iter().zip(&least).filter(|(energy, least)| energy <= least).count();
            let mean = energy.iter().sum::<f32>() / energy.len().max(1) as f32;
            let most = energy.iter().copied().fold(0.0, f32::max);
            println!("| {kind} | {name} | {shortest} of {} | {mean:.3} | {most} |", energy.len());
        }
    }
    Ok(())
}

/// The oracle's data of each mission, percent.
fn oracle(arguments: &Arguments, arena: &Arena, row: Row, setting: Setting) -> Result<Vec<f32>> {
    if arguments.oracle == 0 {
        return Ok(Vec::new());
    }
    let shipped = match row.mismatch.channel_is_nominal() {
        true => known(&read_or_shipped(None)?, setting, arguments.realizations),
        false => None,
    };
    let percent = |reward: &[f32; 2]| reward[0];
    if let Some(shipped) = shipped {
        return Ok(shipped.missions.0.last().into_iter().flatten().map(percent).collect());
    }
    let rates = Rates::new(Arc::clone(&arena.world));
    let thoroughness = Thoroughness { tours: arguments.oracle };
    let best = |(_, realization): &(Seed, Realization)| {
        consult(&rates, realization, thoroughness).last().map_or(0.0, percent)
    };
    Ok(arena.drawn.par_iter().map(best).collect())
}

/// Median and 99th percentile of times in milliseconds.
fn median_and_p99(mut taken: Vec<Duration>) -> String {
    taken.sort_unstable();
    let at = |index: usize| taken.get(index).map_or(0.0, |took| took.as_secs_f64() * 1e3);
    format!("{:.2} ms, 99 % {:.2} ms", at(taken.len() / 2), at(taken.len() * 99 / 100))
}
