//! Import of one's own city and mission: building footprints, devices, fence and rally points.
//!
//! - [`footprints`]: GeoJSON building outlines to heights.
//! - [`placement`]: where the grid lies on the globe: bounding box, cell size, rotation, given or derived.
//! - [`raster`]: outlines to one height a cell.
//! - [`devices`]: devices from GeoJSON points or CSV.
//! - [`plan`]: fence and rally points of a QGroundControl `.plan`.

pub(crate) mod devices;
pub(crate) mod footprints;
pub(crate) mod placement;
pub(crate) mod plan;
pub(crate) mod raster;

use std::path::PathBuf;
use thiserror::Error;

/// Why a file cannot be imported.
#[derive(Debug, Error)]
pub enum ImportError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The text is not UTF-8.
    #[error("{path}: {fault}")]
    Text {
        /// Which file.
        path: PathBuf,
        /// Why.
        fault: gleaner_units::city_file::CityFileError,
    },
    /// Not GeoJSON.
    #[error("{path} is no GeoJSON: {cause}")]
    GeoJson {
        /// Which file.
        path: PathBuf,
        /// Why.
        cause: String,
    },
    /// No outline of a building.
    #[error("{0} has no polygon of a building: export buildings as polygons")]
    NoBuildings(PathBuf),
    /// The grid would be empty or too large.
    #[error("the grid would have {width} x {height} cells, at most {most}: choose --cell or --bbox")]
    GridSize {
        /// Columns.
        width: f64,
        /// Rows.
        height: f64,
        /// The largest number of cells.
        most: usize,
    },
    /// A bounding box that is none.
    #[error("the bounding box {0} is not south,west,north,east in degrees")]
    BoundingBox(String),
    /// A device that cannot be used.
    #[error("{path}, {place}: {cause}")]
    Device {
        /// Which file.
        path: PathBuf,
        /// Line or feature.
        place: String,
        /// Why.
        cause: String,
    },
    /// Not a QGroundControl plan.
    #[error("{path} is no QGroundControl plan: {cause}")]
    Plan {
        /// Which file.
        path: PathBuf,
        /// Why.
        cause: String,
    },
}

/// The text of a file, without a byte order mark.
pub(crate) fn read_text(path: &std::path::Path) -> Result<String, ImportError> {
    let bytes = std::fs::read(path).map_err(|source| ImportError::Read { path: path.into(), source })?;
    let text = gleaner_units::city_file::decode_text(&bytes)
        .map_err(|fault| ImportError::Text { path: path.into(), fault })?;
    Ok(text.to_owned())
}
