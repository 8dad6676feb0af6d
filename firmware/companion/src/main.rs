//! `gleaner`: the pilot on a Linux companion computer.
//!
//! This program wires and reports: it opens ports and files, feeds bytes and the time to
//! [`gleaner_pilot::Onboard`], and carries its bytes away. Nothing is decided here.
//!
//! Exit codes: 0 done, 1 ran but the verdict is negative (`check`, `replay`), 2 could not run. An error is one line on
//! stderr: what, where, what to do.

mod args;
mod bench;
mod check;
mod clock;
mod config;
mod convert;
mod error;
mod load;
mod log;
mod params;
mod ports;
mod replay;
mod run;

use std::process::ExitCode;

fn main() -> ExitCode {
    let command = args::parse();
    if !matches!(command, Ok(args::Command::Run(_))) {
        // `check | head` ends quietly. What flies must outlive whoever reads its messages.
        sigpipe::reset();
    }
    let outcome = match command {
        Ok(args::Command::Run(setup)) => run::run(&setup),
        Ok(args::Command::Check { setup, wait_s }) => check::check(&setup, wait_s),
        Ok(args::Command::Bench(order)) => bench::bench(&order),
        Ok(args::Command::Convert(conversion)) => convert::convert(&conversion),
        Ok(args::Command::Params { config }) => params::params(config.as_deref()),
        Ok(args::Command::Ports) => Ok(ports::ports()),
        Ok(args::Command::Replay(order)) => replay::replay(&order),
        Err(answered) => return answered,
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("gleaner: {error}");
        ExitCode::from(2)
    })
}
