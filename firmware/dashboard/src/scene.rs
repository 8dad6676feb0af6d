//! From a mission to the fixed part of the page.

use crate::flight::{Device, Grid, Scene};
use gleaner_pilot::Mission;
use gleaner_units::{Cell, Rays, Sight as _};

/// The scene of a mission that is flown at `altitude_m` above the ground, without controls and incidents.
///
/// # Cost
/// One ray for each pair of a device and a cell.
#[must_use]
pub fn scene(mission: &Mission, altitude_m: u16, title: String) -> Scene {
    let grid = mission.grid();
    let cells = || {
        let width = grid.width() as i16;
        (0..grid.height() as i16).flat_map(move |y| (0..width).map(move |x| Cell::new(x, y)))
    };
    let fence: Vec<bool> = cells().map(|cell| mission.fence.contains(cell)).collect();
    let rays = Rays { heights: &mission.heights, altitude_m };
    let sees = |device: Cell| cells().map(|cell| if rays.sees(device, cell) { '1' } else { '0' }).collect();
    Scene {
        title,
        grid: Grid {
            width: grid.width(),
            height: grid.height(),
            cell_m: grid.cell().0,
            rotation_deg: mission.pose.rotation.0,
        },
        heights_m: cells().map(|cell| mission.heights.height_m(cell).unwrap_or(0)).collect(),
        fence: fence.contains(&false).then_some(fence),
        sight: mission.devices.iter().map(|site| sees(site.cell)).collect(),
        altitude_m,
        terminal: [mission.terminal.x, mission.terminal.y],
        devices: mission
            .devices
            .iter()
            .map(|site| Device { id: site.id, x: site.cell.x, y: site.cell.y, data: site.data })
            .collect(),
        battery_units: mission.budget.0,
        controls: false,
        incidents: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_pilot::DeviceSite;
    use gleaner_units::{BatteryUnits, CellSet, Degrees, GeoPoint, GridPose, HeightMap, Metres};

    #[test]
    fn the_scene_shows_rotation_fence_and_line_of_sight() {
        let heights = HeightMap::from_csv("0,0,0\n0,50,0", Metres(20.0)).unwrap();
        let mut fence = CellSet::full(heights.grid());
        fence.remove(Cell::new(2, 1));
        let corner = GeoPoint { lat_deg_e7: 470_000_000, lon_deg_e7: 80_000_000 };
        let site = DeviceSite { id: 7, cell: Cell::new(0, 0), data: 100.0 };
        let mission = Mission {
            heights,
            fence,
            pose: GridPose { corner, rotation: Degrees(30.0) },
            terminal: Cell::new(0, 1),
            budget: BatteryUnits(80.0),
            devices: [site].into_iter().collect(),
        };
        let scene = scene(&mission, 60, "test".into());
        assert_eq!(scene.grid.rotation_deg, 30.0);
        assert_eq!(scene.fence, Some(vec![true, true, true, true, true, false]));
        assert_eq!(scene.heights_m, [0, 50, 0, 0, 0, 0]);
        // Seen from above itself and from the north; the building is in the way elsewhere, its corner included.
        assert_eq!(scene.sight, ["100100"]);
    }
}
