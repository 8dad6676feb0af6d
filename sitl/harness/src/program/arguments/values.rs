//! Values on the command line.

use super::order::RadioFormat;
use crate::city::placement::BoundingBox;
use crate::{AutopilotKind, Switch};
use gleaner_units::Duration;
use gleaner_world::ScenarioKind;

/// The grid's rotation, as given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rotation {
    Auto,
    Degrees(f64),
}

fn number(text: &str, range: std::ops::RangeInclusive<f32>, error: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|number| range.contains(number)).ok_or_else(|| error.into())
}

/// `rd` or `rb`, in upper or lower case.
pub(super) fn scenario(text: &str) -> Result<ScenarioKind, String> {
    text.to_lowercase().parse().map_err(|error| format!("{error}"))
}

pub(super) fn autopilot(text: &str) -> Result<AutopilotKind, String> {
    text.parse()
}

pub(super) fn weight(text: &str) -> Result<f32, String> {
    number(text, 0.0..=1.0, "a weight is a number from 0 to 1")
}

pub(super) fn units(text: &str) -> Result<f32, String> {
    number(text, 0.0..=500.0, "battery units are a number from 0 to 500")
}

pub(super) fn grid_rotation(text: &str) -> Result<f32, String> {
    number(text, -180.0..=180.0, "a rotation is a number of degrees from -180 to 180")
}

pub(super) fn speed(text: &str) -> Result<f32, String> {
    number(text, 0.1..=50.0, "a speed is a factor from 0.1 to 50")
}

pub(super) fn speedup(text: &str) -> Result<f32, String> {
    number(text, 1.0..=10.0, "a speed-up is a factor from 1 to 10")
}

/// `seconds:weight`.
pub(super) fn switch(text: &str) -> Result<Switch, String> {
    let (after_s, w_data) = text.split_once(':').ok_or("write seconds:weight, as in 60:0.2")?;
    let after_s =
        number(after_s, 0.0..=4000.0, "the time is a number of seconds from 0 to 4000, as in 60:0.2")?;
    Ok(Switch { after: Duration::from_secs_f32(after_s), w_data: weight(w_data)? })
}

pub(super) fn cell_size(text: &str) -> Result<f32, String> {
    number(text, 1.0..=1000.0, "a cell is 1 to 1000 m wide")
}

pub(super) fn height(text: &str) -> Result<f32, String> {
    number(text, 0.0..=255.0, "a height is a number from 0 to 255 m")
}

pub(super) fn rotation(text: &str) -> Result<Rotation, String> {
    if text == "auto" {
        return Ok(Rotation::Auto);
    }
    number(text, -180.0..=180.0, "a rotation is auto or a number from -180 to 180 degrees")
        .map(|degrees| Rotation::Degrees(degrees.into()))
}

pub(super) fn bounds(text: &str) -> Result<BoundingBox, String> {
    text.parse()
}

/// `latitude,longitude`.
pub(super) fn point(text: &str) -> Result<[f64; 2], String> {
    let error = || "write latitude,longitude in degrees".to_owned();
    let (lat, lon) = text.split_once(',').ok_or_else(error)?;
    let parse = |text: &str, limit: f64| text.trim().parse::<f64>().ok().filter(|n| n.abs() <= limit);
    Ok([parse(lat, 90.0).ok_or_else(error)?, parse(lon, 180.0).ok_or_else(error)?])
}

pub(super) fn radio_format(text: &str) -> Result<RadioFormat, String> {
    match text {
        "cobs" => Ok(RadioFormat::Cobs),
        "json_lines" => Ok(RadioFormat::JsonLines),
        "semtech_udp" => Ok(RadioFormat::SemtechUdp),
        _ => Err("a format is cobs, json_lines or semtech_udp".into()),
    }
}
