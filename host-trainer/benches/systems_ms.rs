//! CPU milliseconds of one update of each system, flights and replay included; minimum of five rounds.
//!
//!     cargo bench -p gleaner-host-trainer --bench systems_ms

mod processor;

use clap::Parser;
use gleaner_host_trainer::env::site::Site;
use gleaner_host_trainer::learn::algorithm::Algorithm;
use gleaner_host_trainer::learn::run::OffPolicyRun;
use gleaner_host_trainer::learn::trainer::Trainer;
use gleaner_host_trainer::settings::Settings;
use gleaner_host_trainer::systems::{DdqnCgl, Gleaner, MosacAtt, MosacCgl, MosacFtv, System};
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

fn measure<A: Algorithm>() {
    let settings = Command::parse_from(["bench", "--warm-up", "1000"]).settings;
    let nowhere = Path::new("/nonexistent");
    let mut run =
        OffPolicyRun::<A>::open(settings, Site::default_site(), nowhere).expect("the default city has room");
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
    let system: System = A::NAME.parse().expect("an algorithm has a system");
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
