//! Frames: the city's grid, the autopilot's local frame, the globe.

use crate::{Cell, Degrees, Grid, Metres};
use nalgebra::{Isometry2, Point2, Vector2};
use serde::{Deserialize, Serialize};

/// A point on the globe (WGS 84). Integers until converted to a local frame, because an `f32` resolves only metres here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GeoPoint {
    /// Latitude, degrees x 1e7, north positive.
    pub lat_deg_e7: i32,
    /// Longitude, degrees x 1e7, east positive.
    pub lon_deg_e7: i32,
}

/// Metres north, east and down of the estimator's origin (`MAV_FRAME_LOCAL_NED`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ned {
    /// North, m.
    pub north_m: f32,
    /// East, m.
    pub east_m: f32,
    /// Down, m: negative in flight.
    pub down_m: f32,
}

impl Ned {
    /// The position at `horizontal` (x east, y north) and `down_m`.
    #[must_use]
    pub fn new(horizontal: Point2<f32>, down_m: f32) -> Ned {
        Ned { north_m: horizontal.y, east_m: horizontal.x, down_m }
    }

    /// The horizontal position: x east, y north, m.
    #[must_use]
    pub fn horizontal(&self) -> Point2<f32> {
        Point2::new(self.east_m, self.north_m)
    }

    /// Whether all coordinates are finite. Only such a position may be sent as a target.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.north_m.is_finite() && self.east_m.is_finite() && self.down_m.is_finite()
    }

    /// Horizontal distance to `other`.
    #[must_use]
    pub fn horizontal_distance(&self, other: &Ned) -> Metres {
        let Vector2 { data, .. } = self.horizontal() - other.horizontal();
        let [[east_m, north_m]] = data.0;
        Metres(libm::hypotf(north_m, east_m))
    }
}

/// A horizontal point of the grid frame: metres from the south-west corner of cell (0, 0) along the grid's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GridPoint {
    /// Along the grid's x axis, m: east if the grid is not rotated.
    pub east_m: f32,
    /// Along the grid's y axis, m: north if the grid is not rotated.
    pub north_m: f32,
}

impl From<Point2<f32>> for GridPoint {
    fn from(point: Point2<f32>) -> GridPoint {
        GridPoint { east_m: point.x, north_m: point.y }
    }
}

impl From<GridPoint> for Point2<f32> {
    fn from(point: GridPoint) -> Point2<f32> {
        Point2::new(point.east_m, point.north_m)
    }
}

/// Metres per degree x 1e-7 of latitude, from ArduPilot's earth radius (6 378 100 m).
const METRES_PER_E7: f64 = 6_378_100.0 * core::f64::consts::PI / 180.0 * 1e-7;

impl GeoPoint {
    /// Offset from `self` to `other` on the tangent plane at `self`: `(north, east)` in metres. Accurate to a centimetre
    /// within two kilometres at moderate latitudes.
    #[must_use]
    pub fn offset_to(&self, other: &GeoPoint) -> (Metres, Metres) {
        let north = f64::from(other.lat_deg_e7) - f64::from(self.lat_deg_e7);
        let mut east = f64::from(other.lon_deg_e7) - f64::from(self.lon_deg_e7);
        // Across the antimeridian the shorter way.
        if east > 1.8e9 {
            east -= 3.6e9;
        } else if east < -1.8e9 {
            east += 3.6e9;
        }
        (Metres((north * METRES_PER_E7) as f32), Metres((east * METRES_PER_E7 * self.cos_lat()) as f32))
    }

    /// The point `north` and `east` of `self`: the inverse of [`GeoPoint::offset_to`].
    #[must_use]
    pub fn offset_by(&self, north: Metres, east: Metres) -> GeoPoint {
        let lat = f64::from(self.lat_deg_e7) + f64::from(north.0) / METRES_PER_E7;
        let mut lon = f64::from(self.lon_deg_e7) + f64::from(east.0) / (METRES_PER_E7 * self.cos_lat());
        if lon > 1.8e9 {
            lon -= 3.6e9;
        } else if lon < -1.8e9 {
            lon += 3.6e9;
        }
        GeoPoint { lat_deg_e7: libm::round(lat) as i32, lon_deg_e7: libm::round(lon) as i32 }
    }

    fn cos_lat(&self) -> f64 {
        libm::cos(f64::from(self.lat_deg_e7) * 1e-7 * core::f64::consts::PI / 180.0)
    }
}

/// The position and the rotation of the grid on the globe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridPose {
    /// The south-west corner of cell (0, 0). The grid is rotated about it.
    pub corner: GeoPoint,
    /// Direction of the grid's y axis, clockwise from true north. With 90 degrees the action `north` flies east.
    pub rotation: Degrees,
}

/// The grid in the autopilot's local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridFrame {
    grid: Grid,
    /// From the grid frame to the local frame, both with x east and y north.
    to_local: Isometry2<f32>,
}

impl GridFrame {
    /// Places `grid` in the local frame with origin `estimator_origin` (MAVLink `GPS_GLOBAL_ORIGIN`).
    #[must_use]
    pub fn new(grid: Grid, pose: GridPose, estimator_origin: GeoPoint) -> GridFrame {
        let (north, east) = estimator_origin.offset_to(&pose.corner);
        // Rotations count counter-clockwise, headings clockwise.
        let to_local = Isometry2::new(Vector2::new(east.0, north.0), -pose.rotation.to_radians());
        GridFrame { grid, to_local }
    }

    /// The grid.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// The centre of `cell` at `down_m`.
    #[must_use]
    pub fn centre(&self, cell: Cell, down_m: f32) -> Ned {
        let cell_m = self.grid.cell().0;
        let centre = Point2::new((f32::from(cell.x) + 0.5) * cell_m, (f32::from(cell.y) + 0.5) * cell_m);
        Ned::new(self.to_local.transform_point(&centre), down_m)
    }

    /// The point of the grid frame below `position`.
    #[must_use]
    pub fn point(&self, position: &Ned) -> GridPoint {
        self.to_local.inverse_transform_point(&position.horizontal()).into()
    }

    /// The cell below `position`; `None` outside the grid or for a position that is not finite.
    #[must_use]
    pub fn cell(&self, position: &Ned) -> Option<Cell> {
        let cell_m = self.grid.cell().0;
        let point = self.point(position);
        let (x, y) = (libm::floorf(point.east_m / cell_m), libm::floorf(point.north_m / cell_m));
        if !(x.is_finite() && y.is_finite()) {
            return None;
        }
        // The casts saturate outside the grid.
        let cell = Cell::new(x as i16, y as i16);
        self.grid.contains(cell).then_some(cell)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CANBERRA: GeoPoint = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };

    fn pose(rotation_deg: f32) -> GridPose {
        GridPose { corner: CANBERRA, rotation: Degrees(rotation_deg) }
    }

    proptest! {
        #[test]
        fn offsets_are_inverse(north in -2000.0f32..2000.0, east in -2000.0f32..2000.0) {
            let there = CANBERRA.offset_by(Metres(north), Metres(east));
            let (n, e) = CANBERRA.offset_to(&there);
            // The integer degrees resolve 1.1 cm.
            prop_assert!((n.0 - north).abs() < 0.012 && (e.0 - east).abs() < 0.012);
        }

        #[test]
        fn centres_are_in_their_cells(
            x in 0i16..40,
            y in 0i16..30,
            north in -500.0f32..500.0,
            east in -500.0f32..500.0,
            rotation in -180.0f32..=180.0,
        ) {
            let grid = Grid::new(40, 30, Metres(20.0)).unwrap();
            let origin = CANBERRA.offset_by(Metres(north), Metres(east));
            let frame = GridFrame::new(grid, pose(rotation), origin);
            let centre = frame.centre(Cell::new(x, y), -60.0);
            prop_assert_eq!(frame.cell(&centre), Some(Cell::new(x, y)));
        }

        #[test]
        fn without_rotation_offsets_add_exactly(
            x in 0i16..40,
            y in 0i16..30,
            north in -500.0f32..500.0,
            east in -500.0f32..500.0,
        ) {
            let grid = Grid::new(40, 30, Metres(20.0)).unwrap();
            let origin = CANBERRA.offset_by(Metres(north), Metres(east));
            let (corner_north, corner_east) = origin.offset_to(&CANBERRA);
            let centre = GridFrame::new(grid, pose(0.0), origin).centre(Cell::new(x, y), -60.0);
            prop_assert_eq!(centre.north_m, corner_north.0 + (f32::from(y) + 0.5) * 20.0);
            prop_assert_eq!(centre.east_m, corner_east.0 + (f32::from(x) + 0.5) * 20.0);
        }
    }

    #[test]
    fn rotation_counts_clockwise_from_north() {
        let grid = Grid::new(40, 30, Metres(20.0)).unwrap();
        let near = |a: f32, b: f32| (a - b).abs() < 1e-3;
        // With 90 degrees the grid's y axis points east and its x axis south.
        let east = GridFrame::new(grid, pose(90.0), CANBERRA).centre(Cell::new(0, 2), -60.0);
        assert!(near(east.north_m, -10.0) && near(east.east_m, 50.0), "{east:?}");
        let tilted = GridFrame::new(grid, pose(30.0), CANBERRA);
        let [first, next] = [0, 1].map(|y| tilted.centre(Cell::new(0, y), -60.0));
        let step = next.horizontal() - first.horizontal();
        assert!(near(step.y, 20.0 * 0.866_025_4) && near(step.x, 10.0), "{step:?}");
        let point = tilted.point(&next);
        assert!(near(point.east_m, 10.0) && near(point.north_m, 30.0), "{point:?}");
    }

    #[test]
    fn outside_and_not_finite_have_no_cell() {
        let grid = Grid::new(40, 30, Metres(20.0)).unwrap();
        let frame = GridFrame::new(grid, pose(0.0), CANBERRA);
        let at = |north_m, east_m| frame.cell(&Ned { north_m, east_m, down_m: -60.0 });
        assert_eq!(at(0.0, 0.0), Some(Cell::new(0, 0)));
        assert_eq!(at(599.9, 799.9), Some(Cell::new(39, 29)));
        assert_eq!(at(-0.1, 5.0), None);
        assert_eq!(at(5.0, 800.1), None);
        assert_eq!(at(f32::NAN, 5.0), None);
        assert_eq!(at(f32::INFINITY, 5.0), None);
        assert_eq!(at(1e30, 1e30), None);
    }

    #[test]
    fn antimeridian_is_crossed_the_short_way() {
        let west = GeoPoint { lat_deg_e7: 0, lon_deg_e7: 1_799_999_000 };
        let there = west.offset_by(Metres(0.0), Metres(50.0));
        assert!(there.lon_deg_e7 < 0);
        assert!((west.offset_to(&there).1.0 - 50.0).abs() < 0.02);
    }
}
