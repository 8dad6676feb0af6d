//! Fence and rally points of a QGroundControl `.plan` file.

use super::placement::Placement;
use super::{ImportError, read_text};
use geo::{Contains, Coord, LineString, Point, Polygon};
use gleaner_units::{Cell, CellSet};
use serde::Deserialize;
use std::path::Path;

/// The parts of a plan that a mission uses.
#[derive(Clone, Debug, Default, Deserialize)]
pub(crate) struct Plan {
    #[serde(rename = "fileType")]
    file_type: String,
    #[serde(default, rename = "geoFence")]
    fence: Fence,
    #[serde(default, rename = "rallyPoints")]
    rally: Rally,
}

#[derive(Clone, Debug, Default, Deserialize)]
struct Fence {
    #[serde(default)]
    polygons: Vec<FencePolygon>,
    #[serde(default)]
    circles: Vec<FenceCircle>,
}

#[derive(Clone, Debug, Deserialize)]
struct FencePolygon {
    inclusion: bool,
    /// Latitude and longitude, degrees.
    polygon: Vec<[f64; 2]>,
}

#[derive(Clone, Debug, Deserialize)]
struct FenceCircle {
    inclusion: bool,
    circle: Circle,
}

#[derive(Clone, Debug, Deserialize)]
struct Circle {
    center: [f64; 2],
    radius: f64,
}

#[derive(Clone, Debug, Default, Deserialize)]
struct Rally {
    /// Latitude, longitude, altitude.
    #[serde(default)]
    points: Vec<[f64; 3]>,
}

impl Plan {
    pub fn read(path: &Path) -> Result<Plan, ImportError> {
        let fail = |cause: String| ImportError::Plan { path: path.into(), cause };
        let plan: Plan = serde_json::from_str(&read_text(path)?).map_err(|error| fail(error.to_string()))?;
        if plan.file_type == "Plan" { Ok(plan) } else { Err(fail("fileType is not \"Plan\"".into())) }
    }

    /// The first rally point: latitude and longitude, degrees.
    pub fn rally_point(&self) -> Option<[f64; 2]> {
        self.rally.points.first().map(|[lat, lon, _]| [*lat, *lon])
    }

    /// The cells whose centre lies inside every inclusion and outside every exclusion.
    pub fn fence(&self, placement: Placement) -> CellSet {
        let to_local = |[lat, lon]: [f64; 2]| {
            let [x, y] = placement.to_grid(lon, lat);
            Coord { x, y }
        };
        let polygons: Vec<(bool, Polygon<f64>)> = self
            .fence
            .polygons
            .iter()
            .map(|FencePolygon { inclusion, polygon }| {
                let ring: LineString<f64> = polygon.iter().copied().map(to_local).collect();
                (*inclusion, Polygon::new(ring, Vec::new()))
            })
            .collect();
        let grid = placement.grid;
        let cell_m = f64::from(grid.cell().0);
        let mut fence = CellSet::full(grid);
        for cell in grid.cells() {
            let centre = |at: i16| (f64::from(at) + 0.5) * cell_m;
            let point = Coord { x: centre(cell.x), y: centre(cell.y) };
            let polygons_agree = polygons
                .iter()
                .all(|(inclusion, polygon)| polygon.contains(&Point::from(point)) == *inclusion);
            let circles_agree = self.fence.circles.iter().all(|FenceCircle { inclusion, circle }| {
                let middle = to_local(circle.center);
                let (dx, dy) = (point.x - middle.x, point.y - middle.y);
                (dx * dx + dy * dy <= circle.radius * circle.radius) == *inclusion
            });
            if !(polygons_agree && circles_agree) {
                fence.remove(cell);
            }
        }
        fence
    }
}

/// The cell under a point, if it lies in the grid.
pub(crate) fn cell_under(placement: Placement, [lat, lon]: [f64; 2]) -> Option<Cell> {
    let [x, y] = placement.to_grid(lon, lat);
    let cell_m = f64::from(placement.grid.cell().0);
    let cell = Cell::new((x / cell_m).floor() as i16, (y / cell_m).floor() as i16);
    placement.grid.contains(cell).then_some(cell)
}

#[cfg(test)]
mod tests {
    use super::super::placement::geo_point;
    use super::*;
    use gleaner_units::{Grid, Metres};

    #[test]
    fn fence_and_rally_point_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("field.plan");
        // 20 m are 0.0001797 degrees of latitude here.
        let text = r#"{"fileType": "Plan", "version": 1, "groundStation": "QGroundControl",
            "geoFence": {"version": 2, "polygons": [{"inclusion": true, "version": 1, "polygon":
                [[-35.3633, 149.1652], [-35.3633, 149.1675], [-35.3628, 149.1675], [-35.3628, 149.1652]]}],
                "circles": [{"inclusion": false, "version": 1, "circle":
                    {"center": [-35.363172, 149.165347], "radius": 8.0}}]},
            "rallyPoints": {"version": 2, "points": [[-35.3630, 149.1660, 50.0]]},
            "mission": {"items": []}}"#;
        std::fs::write(&path, text).unwrap();
        let plan = Plan::read(&path).unwrap();
        let grid = Grid::new(5, 5, Metres(20.0)).unwrap();
        let placement = Placement { grid, corner: geo_point(149.1652374, -35.3632621), rotation_deg: 0.0 };
        let fence = plan.fence(placement);
        assert!(!fence.contains(Cell::new(0, 0)), "the excluded circle");
        assert!(fence.contains(Cell::new(1, 1)) && !fence.contains(Cell::new(1, 3)));
        let rally = plan.rally_point().unwrap();
        assert_eq!(cell_under(placement, rally), Some(Cell::new(3, 1)));
        std::fs::write(&path, "{\"fileType\": \"Mission\"}").unwrap();
        assert!(Plan::read(&path).unwrap_err().to_string().contains("is no QGroundControl plan"));
    }
}
