//! `gleaner-train`: learns, evaluates and exports policies.

mod cli;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    // `evaluate | head` ends quietly.
    sigpipe::reset();
    match cli::run(&cli::Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("gleaner-train: {error:#}");
            ExitCode::from(2)
        }
    }
}
