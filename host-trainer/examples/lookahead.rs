//! Evaluates the shipped policy with and without look-ahead at w = (1, 0), also where channel, map or reports differ from
//! what the aircraft assumes:
//! `cargo run --release -p gleaner-host-trainer --example lookahead -- MODEL REALIZATIONS TOURS [ROW]`.

use anyhow::{Context, Result};
use gleaner_host_trainer::judge::evaluation::{
    Decider, Engine, fly_all_as, fly_greedy, mean_and_std, realizations,
};
use gleaner_host_trainer::judge::lookahead::LookingAhead;
use gleaner_host_trainer::judge::mismatch::{MapError, Mismatch};
use gleaner_lookahead::Budget;
use gleaner_policy::{Engine as Loaded, EngineKind, Preference};
use gleaner_world::{City, Fading, ScenarioKind, Seed};
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let mut next = || arguments.next();
    let model = next().context("MODEL is missing")?;
    let count: u64 = next().context("REALIZATIONS is missing")?.parse()?;
    let tours: u32 = next().context("TOURS is missing")?.parse()?;
    let only = next();
    let w_data: f32 = next().map_or(Ok(1.0), |w| w.parse())?;
    let preference = Preference::new(w_data).context("a weight")?;
    let mut policy = Loaded::load_checked(&std::fs::read(model)?, EngineKind::Native)?;
    let none = Mismatch::default();
    let rows = [
        ("nominal", none),
        ("noise+3", Mismatch { noise_db: 3.0, ..none }),
        ("noise+6", Mismatch { noise_db: 6.0, ..none }),
        ("noise-6", Mismatch { noise_db: -6.0, ..none }),
        ("exponent+0.3", Mismatch { exponent: 0.3, ..none }),
        ("fading", Mismatch { fading: Fading::Rayleigh, ..none }),
        ("reports-10%", Mismatch { missing_reports: 0.1, ..none }),
        ("missing-10%", Mismatch { map: MapError::Missing(0.1), ..none }),
        ("heights-10m", Mismatch { map: MapError::Heights(10), ..none }),
        ("flat", Mismatch { map: MapError::Flat, ..none }),
    ];
    let settings = [(6, 80.0), (10, 100.0)];
    for (name, mismatch) in rows {
        if only.as_deref().is_some_and(|only| only != name && only != "all" && only != "k10") {
            continue;
        }
        for kind in ScenarioKind::ALL {
            let (devices, battery) = settings[usize::from(only.as_deref() == Some("k10"))];
            let scenario =
                kind.scenario().with_devices(devices).with_battery(gleaner_units::BatteryUnits(battery));
            let world = Arc::new(mismatch.world(City::default_city()));
            let map = mismatch.map(world.city(), Seed::evaluation(0));
            let drawn = realizations(&world, &scenario, count)?;
            let fly = |decider: &mut dyn Decider| -> Result<(f32, f32, f32)> {
                let prepare = |flight, seed| mismatch.prepare(flight, map.as_ref(), seed);
                let missions = fly_all_as(&world, &drawn, &[preference], decider, prepare)?;
                let totals = missions.0.iter().flatten();
                let (data, _) = mean_and_std(totals.clone().map(|total| total[0]));
                let (energy, _) = mean_and_std(totals.map(|total| -total[1]));
                Ok((data, energy, w_data * data - (1.0 - w_data) * energy))
            };
            let network = fly(&mut Engine(&mut policy))?;
            let begun = Instant::now();
            let mut looking = LookingAhead::new(&mut policy, Budget { tours });
            let ahead = fly(&mut looking)?;
            let sources = looking.sources();
            let decisions: u64 = sources.iter().sum();
            let greedy = fly_greedy(&world, &drawn).table().coverage();
            println!(
                "{name:>12} {kind}: network {:.1} ({:.1}) | look-ahead {:.1} ({:.1}) utility {:.2} against {:.2} | GREEDY {greedy:.1} | {sources:?} | {:.2} ms",
                network.0,
                network.1,
                ahead.0,
                ahead.1,
                ahead.2,
                network.2,
                1000.0 * begun.elapsed().as_secs_f64() / decisions as f64,
            );
        }
        if only.as_deref() == Some("k10") {
            break;
        }
    }
    Ok(())
}
