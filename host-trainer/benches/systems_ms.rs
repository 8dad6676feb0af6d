//! Milliseconds of one update of each system, with its flights and its replay memory, least of a few rounds.
//!
//!     cargo bench -p gleaner-host-trainer --bench systems_ms

mod processor;

use clap::Parser;
use gleaner_host_trainer::learn::learner::{DdqnCgl, Gleaner, Learner, MosacAtt, MosacCgl, MosacFtv};
use gleaner_host_trainer::learn::learning::Learning;
use gleaner_host_trainer::learn::run::Run;
use gleaner_host_trainer::learn::settings::Settings;
use processor::cpu_ms;
use std::path::Path;

const WARM_UP: usize = 10;
const ROUNDS: usize = 5;
const UPDATES_A_ROUND: usize = 40;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    settings: Settings,
}

fn measure<L: Learner>() {
    let settings = Command::parse_from(["bench", "--warm-up", "1000"]).settings;
    let nowhere = Path::new("/nonexistent");
    let mut run = Run::<L>::open(settings, nowhere).expect("the default city has room");
    for _ in 0..WARM_UP {
        run.advance().expect("the default city has room");
    }
    let mut least = f64::INFINITY;
    for _ in 0..ROUNDS {
        let before = cpu_ms();
        for _ in 0..UPDATES_A_ROUND {
            run.advance().expect("the default city has room");
        }
        let spent = cpu_ms().zip(before).map_or(f64::NAN, |(after, before)| after - before);
        least = least.min(spent / UPDATES_A_ROUND as f64);
    }
    let system = L::SYSTEM;
    println!(
        "{:<10} {:>7} parameters  cpu_ms {least:.2} an update",
        system.title(),
        system.parameter_count()
    );
}

fn main() {
    measure::<Gleaner>();
    measure::<MosacAtt>();
    measure::<MosacCgl>();
    measure::<DdqnCgl>();
    measure::<MosacFtv>();
}
