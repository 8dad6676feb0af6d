//! Devices from GeoJSON points or from CSV with the columns `lat`, `lon`, `id` and `data`.

use super::footprints::{features, number};
use super::{ImportError, read_text};
use csv::{ReaderBuilder, Trim};
use serde::Deserialize;
use std::path::Path;

/// One device as it was imported.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub(crate) struct ImportedDevice {
    #[serde(alias = "lat_deg", alias = "latitude")]
    pub lat: f64,
    #[serde(alias = "lon_deg", alias = "lng", alias = "longitude")]
    pub lon: f64,
    pub id: u32,
    pub data: f32,
}

/// Reads the devices of a file: CSV if its name ends in `.csv`, GeoJSON otherwise.
pub(crate) fn read(path: &Path) -> Result<Vec<ImportedDevice>, ImportError> {
    let csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    let devices = if csv { read_csv(path)? } else { read_points(path)? };
    for (index, (device, place)) in devices.iter().enumerate() {
        let fail =
            |cause: String| Err(ImportError::Device { path: path.into(), place: place.clone(), cause });
        let ImportedDevice { lat, lon, id, data } = *device;
        if !(lat.abs() <= 90.0 && lon.abs() <= 180.0) {
            return fail(format!("{lat}, {lon} is no latitude and longitude: are they swapped?"));
        }
        if !(data.is_finite() && data > 0.0) {
            return fail(format!("data {data} is not an amount above 0"));
        }
        if let Some((_, first)) = devices.iter().take(index).find(|(other, _)| other.id == id) {
            return fail(format!("id {id} is used twice, first at {first}"));
        }
    }
    Ok(devices.into_iter().map(|(device, _)| device).collect())
}

fn read_csv(path: &Path) -> Result<Vec<(ImportedDevice, String)>, ImportError> {
    let text = read_text(path)?;
    let delimiter = if text.lines().next().unwrap_or("").contains(';') { b';' } else { b',' };
    let mut reader = ReaderBuilder::new()
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .trim(Trim::All)
        .flexible(true)
        .from_reader(text.as_bytes());
    let fail = |place: String, cause: String| ImportError::Device { path: path.into(), place, cause };
    let headers = reader.headers().map_err(|error| fail("line 1".into(), error.to_string()))?.clone();
    let lower: csv::StringRecord = headers.iter().map(str::to_lowercase).collect();
    let mut devices = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| fail("the table".into(), error.to_string()))?;
        let place = format!("line {}", record.position().map_or(0, csv::Position::line));
        let device: ImportedDevice = record
            .deserialize(Some(&lower))
            .map_err(|error| fail(place.clone(), format!("{error}: the columns are lat, lon, id, data")))?;
        devices.push((device, place));
    }
    Ok(devices)
}

fn read_points(path: &Path) -> Result<Vec<(ImportedDevice, String)>, ImportError> {
    let mut devices = Vec::new();
    for (index, feature) in features(path)?.into_iter().enumerate() {
        let Some(geometry) = feature.geometry.clone() else { continue };
        let Ok(geo::Geometry::<f64>::Point(point)) = geometry.try_into() else { continue };
        let place = format!("feature {}", index + 1);
        let missing = |key: &str| ImportError::Device {
            path: path.into(),
            place: place.clone(),
            cause: format!("property {key} is missing or no number"),
        };
        let id = number(&feature, "id").ok_or_else(|| missing("id"))? as u32;
        let data = number(&feature, "data").ok_or_else(|| missing("data"))? as f32;
        devices.push((ImportedDevice { lat: point.y(), lon: point.x(), id, data }, place));
    }
    Ok(devices)
}
