//! Frames: the city's grid, the autopilot's local frame, the globe.

use crate::{Cell, Grid, Metres};
use serde::{Deserialize, Serialize};

/// A point on the globe (WGS 84). Integers until made local: a float loses metres here.
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
    /// Down, m: negative when flying.
    pub down_m: f32,
}

impl Ned {
    /// Whether all three are finite. A position target that is not must never be sent.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.north_m.is_finite() && self.east_m.is_finite() && self.down_m.is_finite()
    }

    /// Distance to `other` over the ground.
    #[must_use]
    pub fn horizontal_distance(&self, other: &Ned) -> Metres {
        Metres(libm::hypotf(self.north_m - other.north_m, self.east_m - other.east_m))
    }
}

/// A horizontal point of the grid frame: metres from the south-west corner of cell (0, 0).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GridPoint {
    /// East, m.
    pub east_m: f32,
    /// North, m.
    pub north_m: f32,
}

/// Metres per degree x 1e-7 of latitude, from the mean earth radius that ArduPilot uses (6 378 100 m).
const METRES_PER_E7: f64 = 6_378_100.0 * core::f64::consts::PI / 180.0 * 1e-7;

impl GeoPoint {
    /// Offset from `self` to `other` on the tangent plane at `self`, `(north, east)` in metres. Good to a
    /// centimetre within two kilometres at moderate latitudes.
    #[must_use]
    pub fn offset_to(&self, other: &GeoPoint) -> (Metres, Metres) {
        let north = f64::from(other.lat_deg_e7) - f64::from(self.lat_deg_e7);
        let mut east = f64::from(other.lon_deg_e7) - f64::from(self.lon_deg_e7);
        // The shorter way across the antimeridian.
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

/// Where the grid lies in the autopilot's local frame. The grid's y axis points to true north.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridFrame {
    grid: Grid,
    corner_north_m: f32,
    corner_east_m: f32,
}

impl GridFrame {
    /// Ties `grid`, whose south-west corner is at `corner`, to the local frame with origin `estimator_origin`
    /// (MAVLink `GPS_GLOBAL_ORIGIN`).
    #[must_use]
    pub fn new(grid: Grid, corner: GeoPoint, estimator_origin: GeoPoint) -> GridFrame {
        let (north, east) = estimator_origin.offset_to(&corner);
        GridFrame { grid, corner_north_m: north.0, corner_east_m: east.0 }
    }

    /// The grid that is placed here.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// The centre of `cell` at `down_m`.
    #[must_use]
    pub fn centre(&self, cell: Cell, down_m: f32) -> Ned {
        let cell_m = self.grid.cell().0;
        Ned {
            north_m: self.corner_north_m + (f32::from(cell.y) + 0.5) * cell_m,
            east_m: self.corner_east_m + (f32::from(cell.x) + 0.5) * cell_m,
            down_m,
        }
    }

    /// The point of the grid frame under `position`.
    #[must_use]
    pub fn point(&self, position: &Ned) -> GridPoint {
        GridPoint {
            east_m: position.east_m - self.corner_east_m,
            north_m: position.north_m - self.corner_north_m,
        }
    }

    /// The cell under `position`; `None` outside the grid or for a position that is not finite.
    #[must_use]
    pub fn cell(&self, position: &Ned) -> Option<Cell> {
        let cell_m = self.grid.cell().0;
        let point = self.point(position);
        let (x, y) = (libm::floorf(point.east_m / cell_m), libm::floorf(point.north_m / cell_m));
        if !(x.is_finite() && y.is_finite()) {
            return None;
        }
        // Saturating casts: far outside stays outside.
        let cell = Cell::new(x as i16, y as i16);
        self.grid.contains(cell).then_some(cell)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CANBERRA: GeoPoint = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };

    proptest! {
        #[test]
        fn offsets_are_inverse(north in -2000.0f32..2000.0, east in -2000.0f32..2000.0) {
            let there = CANBERRA.offset_by(Metres(north), Metres(east));
            let (n, e) = CANBERRA.offset_to(&there);
            // The integer degrees resolve 1.1 cm.
            prop_assert!((n.0 - north).abs() < 0.012 && (e.0 - east).abs() < 0.012);
        }

        #[test]
        fn a_centre_lies_in_its_cell(x in 0i16..40, y in 0i16..30, north in -500.0f32..500.0, east in -500.0f32..500.0) {
            let grid = Grid::new(40, 30, Metres(20.0)).unwrap();
            let frame = GridFrame::new(grid, CANBERRA, CANBERRA.offset_by(Metres(north), Metres(east)));
            let centre = frame.centre(Cell::new(x, y), -60.0);
            prop_assert_eq!(frame.cell(&centre), Some(Cell::new(x, y)));
        }
    }

    #[test]
    fn outside_and_not_finite_have_no_cell() {
        let grid = Grid::new(40, 30, Metres(20.0)).unwrap();
        let frame = GridFrame::new(grid, CANBERRA, CANBERRA);
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
    fn the_antimeridian_is_crossed_the_short_way() {
        let west = GeoPoint { lat_deg_e7: 0, lon_deg_e7: 1_799_999_000 };
        let there = west.offset_by(Metres(0.0), Metres(50.0));
        assert!(there.lon_deg_e7 < 0);
        assert!((west.offset_to(&there).1.0 - 50.0).abs() < 0.02);
    }
}
