//! Where the grid lies: bounding box, cell size and rotation, given or derived from the outlines.

use super::ImportError;
use super::footprints::Footprint;
use geo::CoordsIter;
use gleaner_units::{GeoPoint, Grid, MAX_CELLS, Metres};

/// Points are rounded to 1e-7 degrees, about 1.1 cm. An outline that is this much longer than a whole number of cells
/// needs no further cell.
const ROUNDING_M: f64 = 0.05;

/// South, west, north and east edge, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BoundingBox {
    pub south: f64,
    pub west: f64,
    pub north: f64,
    pub east: f64,
}

impl std::str::FromStr for BoundingBox {
    type Err = String;

    fn from_str(text: &str) -> Result<BoundingBox, String> {
        let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
        match numbers[..] {
            [south, west, north, east]
                if south < north && west < east && south.abs() <= 90.0 && north.abs() <= 90.0 =>
            {
                Ok(BoundingBox { south, west, north, east })
            }
            _ => Err("write south,west,north,east in degrees".into()),
        }
    }
}

/// The grid on the globe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    pub grid: Grid,
    /// South-west corner of cell (0, 0).
    pub corner: GeoPoint,
    /// Direction of the grid's north axis, degrees clockwise from true north.
    pub rotation_deg: f64,
}

impl Placement {
    /// The smallest grid with these cells and this rotation that covers the box, or all outlines without one.
    pub fn cover(
        footprints: &[Footprint],
        bounds: Option<BoundingBox>,
        cell: Metres,
        rotation_deg: f64,
    ) -> Result<Placement, ImportError> {
        let points: Vec<(f64, f64)> = match bounds {
            Some(BoundingBox { south, west, north, east }) => {
                vec![(west, south), (west, north), (east, south), (east, north)]
            }
            None => footprints
                .iter()
                .flat_map(|footprint| footprint.outline.coords_iter().map(|at| (at.x, at.y)))
                .collect(),
        };
        let Some(&(lon, lat)) = points.first() else {
            return Err(ImportError::GridSize { width: 0.0, height: 0.0, most: MAX_CELLS });
        };
        let reference = geo_point(lon, lat);
        let unplaced = Placement { grid: Grid::ONE_CELL, corner: reference, rotation_deg };
        let [mut west, mut south, mut east, mut north] =
            [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for (lon, lat) in points {
            let [x, y] = unplaced.to_grid(lon, lat);
            (west, east) = (west.min(x), east.max(x));
            (south, north) = (south.min(y), north.max(y));
        }
        let cell_m = f64::from(cell.0);
        let cells = |length_m: f64| ((length_m - ROUNDING_M) / cell_m).ceil().max(1.0);
        let (width, height) = (cells(east - west), cells(north - south));
        let size = ImportError::GridSize { width, height, most: MAX_CELLS };
        if width * height > MAX_CELLS as f64 {
            return Err(size);
        }
        let grid = Grid::new(width as u16, height as u16, cell).map_err(|_| size)?;
        let [corner_east, corner_north] = rotate([west, south], -rotation_deg);
        let corner = reference.offset_by(Metres(corner_north as f32), Metres(corner_east as f32));
        Ok(Placement { grid, corner, rotation_deg })
    }

    /// Metres east and north in the grid frame.
    pub fn to_grid(self, lon: f64, lat: f64) -> [f64; 2] {
        let (north, east) = self.corner.offset_to(&geo_point(lon, lat));
        rotate([f64::from(east.0), f64::from(north.0)], self.rotation_deg)
    }
}

pub(crate) fn geo_point(lon: f64, lat: f64) -> GeoPoint {
    GeoPoint { lat_deg_e7: (lat * 1e7).round() as i32, lon_deg_e7: (lon * 1e7).round() as i32 }
}

/// East and north turned counter-clockwise.
fn rotate([east, north]: [f64; 2], degrees: f64) -> [f64; 2] {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    [east * cosine - north * sine, east * sine + north * cosine]
}

/// The rotation, from -45 to 45 degrees, with which most wall length is parallel to the grid's axes.
pub(crate) fn derived_rotation_deg(footprints: &[Footprint]) -> f64 {
    // The mean of four times the angle does not distinguish the four directions of a rectangle.
    let (mut sine, mut cosine) = (0.0, 0.0);
    for line in
        footprints.iter().flat_map(|footprint| footprint.outline.iter()).flat_map(|p| p.exterior().lines())
    {
        let from = geo_point(line.start.x, line.start.y);
        let (north, east) = from.offset_to(&geo_point(line.end.x, line.end.y));
        let (north, east) = (f64::from(north.0), f64::from(east.0));
        let length = (north * north + east * east).sqrt();
        let angle = east.atan2(north);
        sine += length * (4.0 * angle).sin();
        cosine += length * (4.0 * angle).cos();
    }
    (sine.atan2(cosine) / 4.0).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geo::{LineString, MultiPolygon, Polygon};

    /// A rectangle of 100 m by 40 m with its south-west corner near Canberra, turned clockwise.
    fn block(rotation_deg: f64) -> Footprint {
        let corner = geo_point(149.1652374, -35.3632621);
        let points = [[0.0, 0.0], [100.0, 0.0], [100.0, 40.0], [0.0, 40.0]].map(|point| {
            let [east, north] = rotate(point, -rotation_deg);
            let at = corner.offset_by(Metres(north as f32), Metres(east as f32));
            (f64::from(at.lon_deg_e7) * 1e-7, f64::from(at.lat_deg_e7) * 1e-7)
        });
        let outline = MultiPolygon::new(vec![Polygon::new(LineString::from(points.to_vec()), Vec::new())]);
        Footprint { outline, height_m: 10.0 }
    }

    #[test]
    fn the_grid_covers_the_outlines() {
        let placement = Placement::cover(&[block(0.0)], None, Metres(20.0), 0.0).unwrap();
        assert_eq!((placement.grid.width(), placement.grid.height()), (5, 2));
        assert!((placement.corner.lat_deg_e7 + 353_632_621).abs() <= 2);
    }

    #[test]
    fn a_derived_rotation_aligns_the_grid_with_the_walls() {
        for degrees in [-30.0, -10.0, 0.0, 12.5, 40.0] {
            let blocks = [block(degrees)];
            let derived = derived_rotation_deg(&blocks);
            assert!((derived - degrees).abs() < 0.2, "{derived} for {degrees}");
            let placement = Placement::cover(&blocks, None, Metres(25.0), derived).unwrap();
            assert_eq!((placement.grid.width(), placement.grid.height()), (4, 2), "{degrees}");
        }
    }

    #[test]
    fn a_grid_that_is_too_large_is_refused() {
        let wide: BoundingBox = "-35.4,149.0,-35.3,149.2".parse().unwrap();
        let error = Placement::cover(&[], Some(wide), Metres(20.0), 0.0).unwrap_err();
        assert!(error.to_string().contains("choose --cell or --bbox"), "{error}");
        assert!("-35.3,149,-35.4,149.2".parse::<BoundingBox>().is_err());
    }
}
