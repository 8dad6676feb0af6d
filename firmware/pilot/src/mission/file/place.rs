//! Places in a mission file: angles to cells, and the likely cause of a place that is wrong.

use crate::Mission;
use gleaner_units::{Cell, GeoPoint, GridFrame, Ned};
use std::format;
use std::string::String;

/// Farther from the city a place is a mistake in the numbers.
const FAR_M: f64 = 100_000.0;

/// The cell under a place, or why there is none, with the likely cause.
pub(super) fn cell_at(mission: &Mission, lat_deg: f64, lon_deg: f64) -> Result<Cell, String> {
    let swapped = point(lon_deg, lat_deg).is_some_and(|point| cell_under(mission, point).is_some());
    let Some(there) = point(lat_deg, lon_deg) else {
        let advice = if swapped { "they are swapped" } else { "are they swapped?" };
        return Err(format!("lat_deg = {lat_deg}, lon_deg = {lon_deg} are no place: {advice}"));
    };
    if let Some(cell) = cell_under(mission, there) {
        return Ok(cell);
    }
    let away_m = distance_m(mission, there);
    let inside = |lat: f64, lon: f64| point(lat, lon).is_some_and(|at| cell_under(mission, at).is_some());
    let advice = if swapped {
        "lat_deg and lon_deg are swapped"
    } else if inside(-lat_deg, lon_deg) {
        "lat_deg has the wrong sign"
    } else if inside(lat_deg, -lon_deg) {
        "lon_deg has the wrong sign"
    } else if inside(-lat_deg, -lon_deg) {
        "both have the wrong sign"
    } else if away_m > FAR_M {
        "correct lat_deg and lon_deg, or the grid's corner"
    } else {
        "move it, or enlarge the city"
    };
    Err(format!("stands outside the city, {} from its corner: {advice}", length(away_m)))
}

/// Height of the building at the terminal, m.
pub(super) fn roof_m(mission: &Mission) -> f32 {
    mission.heights.height(mission.terminal).map_or(0.0, |height| height.0)
}

/// A latitude and longitude that exist.
fn point(lat_deg: f64, lon_deg: f64) -> Option<GeoPoint> {
    let (lat_deg_e7, lon_deg_e7) = degrees_e7(lat_deg, 90.0).zip(degrees_e7(lon_deg, 180.0))?;
    Some(GeoPoint { lat_deg_e7, lon_deg_e7 })
}

/// Great-circle distance from the grid's corner (haversine formula, mean Earth radius).
fn distance_m(mission: &Mission, there: GeoPoint) -> f64 {
    const EARTH_M: f64 = 6_371_008.8;
    let radians = |degrees_e7: i32| (f64::from(degrees_e7) * 1e-7).to_radians();
    let here = mission.pose.corner;
    let (lat, other) = (radians(here.lat_deg_e7), radians(there.lat_deg_e7));
    let half_lat = (other - lat) / 2.0;
    let half_lon = (radians(there.lon_deg_e7) - radians(here.lon_deg_e7)) / 2.0;
    let chord = half_lat.sin().powi(2) + lat.cos() * other.cos() * half_lon.sin().powi(2);
    2.0 * EARTH_M * chord.sqrt().min(1.0).asin()
}

fn length(metres: f64) -> String {
    if metres < 10_000.0 { format!("{metres:.0} m") } else { format!("{:.0} km", metres / 1000.0) }
}

fn cell_under(mission: &Mission, point: GeoPoint) -> Option<Cell> {
    let (north, east) = mission.pose.corner.offset_to(&point);
    let position = Ned { north_m: north.0, east_m: east.0, down_m: 0.0 };
    GridFrame::new(mission.grid(), mission.pose, mission.pose.corner).cell(&position)
}

/// Angles in the mission are whole multiples of 1e-7 degrees.
pub(super) fn degrees_e7(degrees: f64, limit: f64) -> Option<i32> {
    // Written so that NaN is refused.
    (degrees >= -limit && degrees <= limit).then(|| (degrees * 1e7).round() as i32)
}
