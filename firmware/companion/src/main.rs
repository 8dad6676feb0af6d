//! `gleaner`: the pilot on a Linux companion computer.
//!
//! The program opens ports and files, hands bytes and the time to [`gleaner_pilot::Onboard`], and sends what comes
//! back. All decisions are made there.
//!
//! Exit codes: 0 done, 1 the verdict is negative (`check`, `replay`, `bench`), 2 could not run. An error is one line on stderr:
//! what, where, what to do.

mod args;
mod bench;
mod check;
mod clock;
mod config;
#[cfg(feature = "tract")]
mod contract;
mod convert;
mod error;
mod keep;
mod load;
mod logs;
mod mission;
mod models;
mod params;
mod ports;
mod radio;
mod replay;
mod report;
mod routing;
mod run;
mod seal;
mod text;

use args::Command;
use std::process::ExitCode;

fn main() -> ExitCode {
    let command = args::parse();
    if !matches!(command, Ok(Command::Run(_))) {
        // `check | head` ends quietly. `run` must not end because a reader of its messages does.
        sigpipe::reset();
    }
    let outcome = match command {
        Ok(Command::Run(order)) => run::run(&order),
        Ok(Command::Check { setup, wait_s }) => check::check(&setup, wait_s),
        Ok(Command::Bench(order)) => bench::bench(&order),
        Ok(Command::Convert(order)) => convert::convert(&order),
        Ok(Command::Params { config }) => params::params(config.as_deref()),
        Ok(Command::Ports) => Ok(ports::ports()),
        Ok(Command::Replay(order)) => replay::replay(&order),
        Ok(Command::Report(order)) => report::report(&order),
        Ok(Command::Mission(order)) => mission::mission(&order),
        Ok(Command::Seal(order)) => seal::run(&order),
        Err(answered) => return answered,
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("gleaner: {error}");
        ExitCode::from(2)
    })
}
