//! Building outlines to one height a cell.

use super::footprints::Footprint;
use super::placement::Placement;
use geo::{BoundingRect, Coord, Intersects, MapCoords, Rect};
use gleaner_units::{Cell, HeightMap};

/// Heights of a grid, and what did not fit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Raster {
    pub heights: HeightMap,
    /// Buildings outside the grid.
    pub outside: usize,
    /// Buildings above 255 m, which is written instead.
    pub capped: usize,
}

/// The highest building that touches a cell gives its height, rounded up to whole metres. Courtyards (holes in an
/// outline) stay open where they cover a whole cell.
pub(crate) fn rasterise(footprints: &[Footprint], placement: Placement) -> Raster {
    let grid = placement.grid;
    let cell_m = f64::from(grid.cell().0);
    let mut raster = Raster { heights: HeightMap::flat(grid), outside: 0, capped: 0 };
    for Footprint { outline, height_m } in footprints {
        let local = outline.map_coords(|at| {
            let [x, y] = placement.to_grid(at.x, at.y);
            Coord { x, y }
        });
        let Some(bounds) = local.bounding_rect() else { continue };
        let whole = height_m.ceil();
        raster.capped += usize::from(whole > 255.0);
        let height = whole.min(255.0) as u8;
        let range = |low: f64, high: f64, cells: u16| {
            let first = (low / cell_m).floor().max(0.0) as i16;
            let last = (high / cell_m).floor().min(f64::from(cells) - 1.0) as i16;
            first..=last
        };
        let columns = range(bounds.min().x, bounds.max().x, grid.width());
        let rows = range(bounds.min().y, bounds.max().y, grid.height());
        let mut inside = false;
        for y in rows {
            for x in columns.clone() {
                // Slightly smaller than the cell, so that a wall on the edge belongs to one side only.
                let edge = 1e-3 * cell_m;
                let low = Coord { x: f64::from(x) * cell_m + edge, y: f64::from(y) * cell_m + edge };
                let high = Coord { x: low.x + cell_m - 2.0 * edge, y: low.y + cell_m - 2.0 * edge };
                if local.intersects(&Rect::new(low, high)) {
                    inside = true;
                    let cell = Cell::new(x, y);
                    let before = raster.heights.height_m(cell).unwrap_or(0);
                    raster.heights.set(cell, before.max(height));
                }
            }
        }
        raster.outside += usize::from(!inside);
    }
    raster
}

#[cfg(test)]
mod tests {
    use super::super::placement::geo_point;
    use super::*;
    use geo::{LineString, MultiPolygon, Polygon};
    use gleaner_units::{Grid, Metres};

    fn placement() -> Placement {
        let grid = Grid::new(5, 5, Metres(20.0)).unwrap();
        Placement { grid, corner: geo_point(149.1652374, -35.3632621), rotation_deg: 0.0 }
    }

    /// A ring of points in metres of the grid.
    fn ring(points: &[[f64; 2]]) -> LineString<f64> {
        let corner = placement().corner;
        let degrees = points.iter().map(|[east, north]| {
            let at = corner.offset_by(Metres(*north as f32), Metres(*east as f32));
            (f64::from(at.lon_deg_e7) * 1e-7, f64::from(at.lat_deg_e7) * 1e-7)
        });
        LineString::from(degrees.collect::<Vec<_>>())
    }

    fn square(low: f64, high: f64) -> LineString<f64> {
        ring(&[[low, low], [high, low], [high, high], [low, high]])
    }

    fn footprint(exterior: LineString<f64>, holes: Vec<LineString<f64>>, height_m: f64) -> Footprint {
        Footprint { outline: MultiPolygon::new(vec![Polygon::new(exterior, holes)]), height_m }
    }

    #[test]
    fn the_highest_building_of_a_cell_wins_rounded_up() {
        let low = footprint(square(5.0, 15.0), vec![], 10.0);
        let high = footprint(square(12.0, 35.0), vec![], 17.2);
        let raster = rasterise(&[high, low], placement());
        assert_eq!(raster.heights.height_m(Cell::new(0, 0)), Some(18));
        assert_eq!(raster.heights.height_m(Cell::new(1, 1)), Some(18));
        assert_eq!(raster.heights.height_m(Cell::new(2, 2)), Some(0));
    }

    #[test]
    fn courtyards_stay_open_and_far_buildings_are_counted() {
        let block = footprint(square(1.0, 99.0), vec![square(19.0, 81.0)], 300.0);
        let far = footprint(square(500.0, 600.0), vec![], 10.0);
        let raster = rasterise(&[block, far], placement());
        assert_eq!(raster.heights.height_m(Cell::new(2, 2)), Some(0));
        assert_eq!(raster.heights.height_m(Cell::new(0, 2)), Some(255));
        assert_eq!((raster.outside, raster.capped), (1, 1));
    }
}
