//! The mission of a flight: drawn in a city, or read from a mission file.

use super::ProgramError;
use super::arguments::MissionOrder;
use crate::{FlightError, MissionSetup};
use gleaner_pilot::mission_file;
use gleaner_units::city_file::{self, read_city};
use gleaner_world::{Channel, City, World};
use std::path::Path;
use std::sync::Arc;

/// Sets up the mission that was ordered.
pub(super) fn setup(order: &MissionOrder) -> Result<MissionSetup, ProgramError> {
    let setup = match (&order.mission, &order.city) {
        (Some(path), _) => {
            let mission = read_mission(path)?;
            MissionSetup::of_mission(mission, order.plan)
        }
        (None, Some(path)) => MissionSetup::new(Arc::new(world(read_city_file(path)?)), order.plan),
        (None, None) => MissionSetup::new(Arc::new(World::default_world()), order.plan),
    };
    Ok(setup.map_err(FlightError::from)?)
}

/// A city under the default channel.
pub(super) fn world(city: City) -> World {
    World::new(city, Channel::default())
}

/// Reads a city file with cells of 20 m.
pub(super) fn read_city_file(path: &Path) -> Result<City, ProgramError> {
    let bytes = std::fs::read(path).map_err(|source| ProgramError::Read { path: path.into(), source })?;
    let wrong = |cause: String| ProgramError::Input { path: path.into(), cause };
    let read = read_city(&bytes, City::CELL).map_err(|error| wrong(error.to_string()))?;
    if read.rounded > 0 {
        eprintln!(
            "{}: {} heights with decimals were rounded up to whole metres",
            path.display(),
            read.rounded
        );
    }
    City::new(read.heights).map_err(|error| wrong(error.to_string()))
}

/// Reads a mission file and the city file beside it.
pub(super) fn read_mission(path: &Path) -> Result<gleaner_pilot::Mission, ProgramError> {
    let bytes = std::fs::read(path).map_err(|source| ProgramError::Read { path: path.into(), source })?;
    let wrong = |cause: String| ProgramError::Input { path: path.into(), cause };
    let text = city_file::decode_text(&bytes).map_err(|error| wrong(error.to_string()))?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let city = |name: &str| -> Result<String, String> {
        let bytes = std::fs::read(folder.join(name)).map_err(|error| error.to_string())?;
        let text = city_file::decode_text(&bytes).map_err(|error| error.to_string())?;
        Ok(text.to_owned())
    };
    mission_file::read(text, city).map_err(|error| wrong(error.to_string()))
}
