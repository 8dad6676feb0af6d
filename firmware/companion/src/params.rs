//! `gleaner params`: the parameters that a ground station will see, and the values that a configuration gives them.

use crate::config;
use crate::error::StartError;
use gleaner_link::PARAMETERS;
use std::path::Path;
use std::process::ExitCode;

/// Prints each parameter with the value that it has after the start.
///
/// # Errors
/// The configuration cannot be read, or a value in it is out of range.
pub fn params(config: Option<&Path>) -> Result<ExitCode, StartError> {
    let defaults = config::default_parameters();
    let parameters = config.map_or_else(|| Ok(defaults.clone()), config::parameters)?;
    println!("{:<13} {:>6} {:>8}  {:<9} {:<6} meaning", "parameter", "value", "default", "range", "unit");
    for spec in PARAMETERS {
        let value = parameters.value(spec.id);
        let range = format!("{}..{}", spec.min, spec.max);
        println!(
            "{:<13} {value:>6} {:>8}  {range:<9} {:<6} {}",
            spec.name,
            defaults.value(spec.id),
            spec.unit,
            spec.doc
        );
    }
    Ok(ExitCode::SUCCESS)
}
