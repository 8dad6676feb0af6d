//! `gleaner bench`: the time of one inference in each engine, and of a whole decision on this computer.

mod decision;
mod engines;

use crate::args::Bench;
use crate::error::StartError;
use std::process::ExitCode;
use std::time::Duration;

/// Prints the times. The exit code is 1 if a decision takes longer than it may.
///
/// # Errors
/// An engine of this program refuses the model.
pub fn bench(order: &Bench) -> Result<ExitCode, StartError> {
    engines::compare(order)?;
    let is_fast = decision::time(order)?;
    Ok(if is_fast { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Measured times.
#[derive(Default)]
struct Times(Vec<Duration>);

impl Times {
    /// The time that this share of the measured times does not exceed.
    fn quantile(&mut self, share: f64) -> Duration {
        self.0.sort_unstable();
        let index = self.0.len().saturating_sub(1) as f64 * share;
        self.0.get(index as usize).copied().unwrap_or_default()
    }

    fn micros(&mut self, share: f64) -> f64 {
        self.quantile(share).as_secs_f64() * 1e6
    }
}
