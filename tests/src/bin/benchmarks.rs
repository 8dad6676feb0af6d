//! Measures this project beside its peers and writes `docs/benchmarks.md`.
//!
//! `cargo run --release -p gleaner-tests --bin benchmarks [PART...]`; without a part, all of them.

use gleaner_tests::benchmarks;
use std::process::ExitCode;

fn main() -> ExitCode {
    let parts: Vec<String> = std::env::args().skip(1).collect();
    match benchmarks::run(&parts) {
        Ok(()) => ExitCode::SUCCESS,
        Err(cause) => {
            eprintln!("benchmarks: {cause:#}");
            ExitCode::from(2)
        }
    }
}
