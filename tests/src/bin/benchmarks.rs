//! Measures this project beside its peers and writes `docs/benchmarks.md`.
//!
//! `cargo build --release --workspace --bins && target/release/benchmarks [PART...]`; without a part, all of them. Needs
//! Python 3.11, and valgrind for the last part. `GLEANER_TORCH_PYTHON` names a Python that has PyTorch.

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
