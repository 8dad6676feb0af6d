//! `gleaner-sitl`: the simulated city, its aircraft and its radio.

use gleaner_harness::program::{Arguments, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    // `fly | head` ends quietly.
    sigpipe::reset();
    let arguments = match Arguments::read() {
        Ok(arguments) => arguments,
        Err(code) => return ExitCode::from(code),
    };
    match run(arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("gleaner-sitl: {error}");
            ExitCode::from(2)
        }
    }
}
