//! The time of one inference in each engine, side by side.

use super::Times;
use crate::args::Bench;
use crate::error::StartError;
use crate::load;
use gleaner_policy::{Engine, EngineKind, Golden, Policy};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Inferences of one engine before the turn of the next. In turns of one, each engine would find the processor's caches full
/// of the other's weights, which slows the native engine down several times.
const TURN: u32 = 20;

/// Prints minimum and median of each engine, and the ratio of medians of two, for each number of devices in the golden
/// pairs.
///
/// # Errors
/// An engine of this program refuses the model.
pub(super) fn compare(order: &Bench) -> Result<(), StartError> {
    let kinds = EngineKind::ALL.into_iter().filter(|kind| kind.is_built());
    let mut engines =
        kinds.map(|kind| load::model(order.model.as_deref(), Some(kind))).collect::<Result<Vec<_>, _>>()?;
    let mut goldens: Vec<Golden> = Vec::new();
    for golden in engines.iter().flat_map(Engine::goldens) {
        if goldens.iter().all(|other| other.tokens.devices.len() != golden.tokens.devices.len()) {
            goldens.push(golden.clone());
        }
    }
    for engine in &engines {
        println!(
            "{} {} in {engine}, {} inferences in turns of {TURN}; us",
            engine.name(),
            engine.version(),
            order.inferences
        );
    }
    print!("devices");
    engines.iter().for_each(|engine| print!("{:>10} minimum    median", engine.kind().name()));
    println!("{}", if engines.len() > 1 { "    ratio of medians" } else { "" });
    for golden in &goldens {
        let mut times: Vec<Times> = engines.iter().map(|_| Times::default()).collect();
        for turn in (0..order.inferences).step_by(TURN as usize) {
            for (engine, times) in engines.iter_mut().zip(&mut times) {
                // Not counted: it loads the weights into the caches.
                let _ = engine.infer(&golden.tokens);
                (turn..order.inferences.min(turn.saturating_add(TURN)))
                    .for_each(|_| times.0.push(inference(engine, golden)));
            }
        }
        print!("{:7}", golden.tokens.devices.len());
        let times: Vec<[f64; 2]> =
            times.iter_mut().map(|times| [0.0, 0.5].map(|share| times.micros(share))).collect();
        times.iter().for_each(|[least, median]| print!("{least:18.1}  {median:8.1}"));
        match times[..] {
            [[_, first], [_, second]] => println!("    {:.2}", first / second),
            _ => println!(),
        }
    }
    Ok(())
}

fn inference(engine: &mut Engine, golden: &Golden) -> Duration {
    let start = Instant::now();
    // Cannot fail: the self-test ran the same inference.
    let _ = black_box(engine.infer(black_box(&golden.tokens)));
    start.elapsed()
}
