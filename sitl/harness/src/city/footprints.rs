//! Building outlines of a GeoJSON file, as OpenStreetMap tools export them.

use super::{ImportError, read_text};
use geo::{MultiPolygon, Polygon};
use geojson::{Feature, FeatureCollection, GeoJson};
use serde_json::Value;
use std::path::Path;

/// How heights are read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeightRules {
    /// Height of one level, m, for `building:levels`.
    pub level_m: f64,
    /// Height of a building without `height` and `building:levels`, m.
    pub default_m: f64,
}

/// One building: outline in degrees (x longitude, y latitude), and height.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Footprint {
    pub outline: MultiPolygon<f64>,
    pub height_m: f64,
}

/// How many buildings got their height from where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sources {
    pub measured: usize,
    pub levels: usize,
    pub default: usize,
}

/// Reads the polygons and multipolygons of a file. Features with `building` = `no` and other geometries are left out.
pub(crate) fn read(path: &Path, rules: HeightRules) -> Result<(Vec<Footprint>, Sources), ImportError> {
    let (mut footprints, mut sources) = (Vec::new(), Sources::default());
    for feature in features(path)? {
        let Some(outline) = outline(&feature) else { continue };
        if feature.property("building").and_then(Value::as_str) == Some("no") {
            continue;
        }
        let height_m = match (number(&feature, "height"), number(&feature, "building:levels")) {
            (Some(height_m), _) => {
                sources.measured += 1;
                height_m
            }
            (None, Some(levels)) => {
                sources.levels += 1;
                levels * rules.level_m
            }
            (None, None) => {
                sources.default += 1;
                rules.default_m
            }
        };
        footprints.push(Footprint { outline, height_m: height_m.max(0.0) });
    }
    if footprints.is_empty() { Err(ImportError::NoBuildings(path.into())) } else { Ok((footprints, sources)) }
}

/// The features of a GeoJSON file.
pub(super) fn features(path: &Path) -> Result<Vec<Feature>, ImportError> {
    let fail = |cause: String| ImportError::GeoJson { path: path.into(), cause };
    let text = read_text(path)?;
    match text.parse::<GeoJson>().map_err(|error| fail(error.to_string()))? {
        GeoJson::FeatureCollection(FeatureCollection { features, .. }) => Ok(features),
        GeoJson::Feature(feature) => Ok(vec![feature]),
        GeoJson::Geometry(_) => Err(fail("a bare geometry: wrap it in a feature".into())),
    }
}

fn outline(feature: &Feature) -> Option<MultiPolygon<f64>> {
    let geometry = feature.geometry.clone()?;
    match geo::Geometry::<f64>::try_from(geometry).ok()? {
        geo::Geometry::Polygon(polygon) => Some(MultiPolygon::<f64>::from(polygon)),
        geo::Geometry::MultiPolygon(polygons) => Some(polygons),
        geo::Geometry::GeometryCollection(parts) => {
            let polygons: Vec<Polygon<f64>> = parts
                .into_iter()
                .filter_map(
                    |part| if let geo::Geometry::Polygon(polygon) = part { Some(polygon) } else { None },
                )
                .collect();
            (!polygons.is_empty()).then(|| MultiPolygon::new(polygons))
        }
        _ => None,
    }
}

/// A number, or a text that begins with one: "17.5", "17.5 m", "17,5".
pub(super) fn number(feature: &Feature, key: &str) -> Option<f64> {
    match feature.property(key)? {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => {
            let text = text.trim().replace(',', ".");
            let end =
                text.find(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-')).unwrap_or(text.len());
            text.get(..end)?.parse().ok()
        }
        _ => None,
    }
    .filter(|number| number.is_finite())
}
