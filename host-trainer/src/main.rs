//! `gleaner-train`: trains, evaluates and exports policies.

mod cli;

use std::process::ExitCode;

/// The command could not run.
const FAILED: u8 = 2;
/// Ctrl-C stopped it (128 + SIGINT).
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    // `evaluate | head` ends without an error.
    sigpipe::reset();
    match cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("gleaner-train: {error:#}");
            ExitCode::from(if error.is::<cli::Interrupted>() { INTERRUPTED } else { FAILED })
        }
    }
}
