//! `gleaner bench`: the time of one inference in each engine.

use crate::args::Bench;
use crate::error::StartError;
use crate::load;
use gleaner_policy::{Engine, EngineKind, Golden, Policy};
use std::hint::black_box;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Prints minimum and median of both engines, and their ratio, for each number of devices in the golden pairs.
///
/// # Errors
/// The model cannot be loaded in both engines.
pub fn bench(order: &Bench) -> Result<ExitCode, StartError> {
    let [tract, native] =
        [EngineKind::Tract, EngineKind::Native].map(|kind| load::model(order.model.as_deref(), kind));
    let [mut tract, mut native] = [tract?, native?];
    let mut pairs: Vec<&Golden> = Vec::new();
    let goldens = native.goldens().to_vec();
    for golden in &goldens {
        if pairs.iter().all(|pair| pair.tokens.devices.len() != golden.tokens.devices.len()) {
            pairs.push(golden);
        }
    }
    println!("{} {}, {} inferences each, alternating; us", native.name(), native.version(), order.inferences);
    println!("devices    tract minimum  median    native minimum  median    ratio of medians");
    for golden in pairs {
        let [mut slow, mut fast] = [Times::default(), Times::default()];
        for _ in 0..order.inferences {
            slow.add(&mut tract, golden);
            fast.add(&mut native, golden);
        }
        let ([slow_least, slow_median], [fast_least, fast_median]) = (slow.micros(), fast.micros());
        let ratio = slow_median / fast_median;
        println!(
            "{:7}    {slow_least:13.1}  {slow_median:6.1}    {fast_least:14.1}  {fast_median:6.1}    {ratio:.2}",
            golden.tokens.devices.len()
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// The duration of each inference.
#[derive(Default)]
struct Times(Vec<Duration>);

impl Times {
    fn add(&mut self, engine: &mut Engine, golden: &Golden) {
        let start = Instant::now();
        // Its answers were verified when it was loaded.
        let _ = black_box(engine.infer(black_box(&golden.tokens)));
        self.0.push(start.elapsed());
    }

    /// Minimum and median.
    fn micros(&mut self) -> [f64; 2] {
        self.0.sort_unstable();
        let at = |index: usize| self.0.get(index).map_or(f64::NAN, |took| took.as_secs_f64() * 1e6);
        [at(0), at(self.0.len() / 2)]
    }
}
