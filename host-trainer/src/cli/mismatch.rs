//! `evaluate` in a world that differs from the policy's model.

use gleaner_host_trainer::env::mismatch::{MapError, Mismatch};
use gleaner_world::Fading;
use std::fmt;
use std::str::FromStr;

/// Differences between the world and the nominal one. The policy and its map features use the nominal one. The oracle, when
/// it is run, uses the true world. GREEDY uses no map, and the true remaining data.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Mismatch: the world differs from the policy's model")]
pub struct MismatchArguments {
    /// Noise above the nominal level, dB; may be negative.
    #[arg(long, value_name = "DB", allow_negative_numbers = true, default_value_t = 0.0)]
    noise: f32,
    /// Added to both path loss exponents; may be negative.
    #[arg(long, value_name = "D", allow_negative_numbers = true, default_value_t = 0.0)]
    exponent: f32,
    /// Rayleigh fading on every link.
    #[arg(long)]
    fading: bool,
    /// The policy has no building map.
    #[arg(long, conflicts_with = "map_error")]
    no_map: bool,
    /// Error of the policy's map: `missing=SHARE` leaves out this share of the building cells, `heights=METRES` makes each
    /// building that much too high or too low.
    #[arg(long, value_name = "ERROR")]
    map_error: Option<MapErrorArgument>,
    /// Share of the devices' reports that are lost.
    #[arg(long, value_name = "SHARE", value_parser = share)]
    missing_reports: Option<f64>,
}

/// `missing=0.1` or `heights=10`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct MapErrorArgument(MapError);

impl FromStr for MapErrorArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<MapErrorArgument, String> {
        let error = match text.split_once('=') {
            Some(("missing", value)) => MapError::Missing(share(value)?),
            Some(("heights", value)) => {
                MapError::Heights(value.parse().map_err(|_| "heights=METRES: a whole number up to 255")?)
            }
            _ => return Err("use missing=SHARE or heights=METRES".to_owned()),
        };
        Ok(MapErrorArgument(error))
    }
}

fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err("a share lies between 0 and 1".to_owned()) }
}

impl MismatchArguments {
    /// Whether the channel is the nominal one. What the policy knows does not concern the oracle.
    pub fn channel_is_nominal(&self) -> bool {
        self.mismatch().channel_is_nominal()
    }

    /// The mismatch.
    pub fn mismatch(&self) -> Mismatch {
        let map = match self.map_error {
            _ if self.no_map => MapError::Flat,
            Some(MapErrorArgument(error)) => error,
            None => MapError::None,
        };
        Mismatch {
            noise_db: self.noise,
            exponent: self.exponent,
            fading: if self.fading { Fading::Rayleigh } else { Fading::None },
            map,
            missing_reports: self.missing_reports.unwrap_or(0.0),
        }
    }
}

/// `, noise +3 dB, no map`, or nothing.
impl fmt::Display for MismatchArguments {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.noise != 0.0 {
            write!(f, ", noise {:+} dB", self.noise)?;
        }
        if self.exponent != 0.0 {
            write!(f, ", exponents {:+}", self.exponent)?;
        }
        if self.fading {
            write!(f, ", Rayleigh fading")?;
        }
        match self.mismatch().map {
            MapError::None => {}
            MapError::Flat => write!(f, ", no map")?,
            MapError::Missing(share) => write!(f, ", {} % of the buildings not in the map", 100.0 * share)?,
            MapError::Heights(by_m) => write!(f, ", heights in the map off by {by_m} m")?,
        }
        if let Some(share) = self.missing_reports {
            write!(f, ", {} % of the reports lost", 100.0 * share)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mismatch_describes_itself() {
        assert_eq!(MismatchArguments::default().to_string(), "");
        assert_eq!(MismatchArguments::default().mismatch(), Mismatch::default());
        let arguments = MismatchArguments {
            noise: 3.0,
            exponent: -0.25,
            no_map: true,
            missing_reports: Some(0.1),
            ..MismatchArguments::default()
        };
        assert_eq!(arguments.to_string(), ", noise +3 dB, exponents -0.25, no map, 10 % of the reports lost");
        assert_eq!("missing=0.1".parse(), Ok(MapErrorArgument(MapError::Missing(0.1))));
        assert_eq!("heights=10".parse(), Ok(MapErrorArgument(MapError::Heights(10))));
        for wrong in ["0.1", "missing=2", "heights=tall"] {
            assert!(wrong.parse::<MapErrorArgument>().is_err(), "{wrong}");
        }
    }
}
