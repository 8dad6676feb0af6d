//! The centred local and global maps of the CGL systems (paper, section III-C; after Theile et al. 2021).
//!
//! Four layers, all centred on the aircraft: building heights; the zones, 1 at the start and -1 at the terminal (-1
//! where both are one cell, a case that the paper leaves open); the data left at each device; the aircraft. Outside the
//! city the height is the greatest possible and everything else is 0. The global map averages windows of 5 x 5 cells,
//! with the aircraft in the middle of the middle window: of the 79 x 59 cells that a centred 40 x 30 city can span it
//! shows 75 x 55.
//!
//! The replay memory stores a [`Scene`]; the maps are drawn when a batch is packed.

use crate::env::flight::Flight;
use crate::net::{
    GLOBAL_NUMBERS, GLOBAL_SIZE, GLOBAL_WINDOW, LOCAL_NUMBERS, LOCAL_SIDE, MAP_CHANNELS, MapBatch, MapShape,
};
use crate::observe::{Encoding, weights};
use gleaner_policy::{Preference, schema};
use gleaner_units::{Cell, HeightMap, Metres};
use gleaner_world::City;
use serde::{Deserialize, Serialize};

/// Indices of the layers.
const HEIGHTS: usize = 0;
const ZONES: usize = 1;
const DATA: usize = 2;
const AIRCRAFT: usize = 3;

/// Cells of the local map west and south of the aircraft; one less east and north.
const LOCAL_REACH: i16 = (LOCAL_SIDE / 2) as i16;
/// Windows of the global map west and south of the aircraft's window.
const GLOBAL_MIDDLE: (i16, i16) = ((GLOBAL_SIZE.0 / 2) as i16, (GLOBAL_SIZE.1 / 2) as i16);
/// Side of a window, cells.
const WINDOW: i16 = GLOBAL_WINDOW as i16;
/// Height outside the city, m.
const OUTSIDE_HEIGHT_M: f32 = 50.0;
/// Height that enters the network as 1, m.
const HEIGHT_SCALE_M: f32 = 50.0;
/// Weight of one cell in the mean of its window.
const CELL_SHARE: f32 = 1.0 / (GLOBAL_WINDOW * GLOBAL_WINDOW) as f32;

type LocalMap = [f32; LOCAL_NUMBERS];
type GlobalMap = [f32; GLOBAL_NUMBERS];

/// What the replay memory stores: about 100 bytes with six devices, where the drawn maps have 4,240.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    uav: Cell,
    start: Cell,
    terminal: Cell,
    battery_units: f32,
    spare_units: f32,
    /// Cell and remaining data of each device, data units.
    devices: Vec<(Cell, f32)>,
}

impl Scene {
    /// The current state of a flight.
    pub(crate) fn of(flight: &Flight) -> Scene {
        let episode = flight.episode();
        Scene {
            uav: episode.uav(),
            start: flight.start(),
            terminal: episode.terminal(),
            battery_units: episode.battery().0,
            spare_units: flight.spare().0,
            devices: (episode.devices().iter().enumerate())
                .map(|(index, device)| (device.cell, flight.report(index).1))
                .collect(),
        }
    }

    /// Calls `mark(cell, layer, value)` for everything but the heights.
    fn marks(&self, mut mark: impl FnMut(Cell, usize, f32)) {
        if self.start != self.terminal {
            mark(self.start, ZONES, 1.0);
        }
        mark(self.terminal, ZONES, -1.0);
        for &(cell, remaining_units) in &self.devices {
            mark(cell, DATA, schema::REMAINING.apply(remaining_units));
        }
        mark(self.uav, AIRCRAFT, 1.0);
    }
}

/// The normalised height of a cell.
pub(crate) fn height(heights: &HeightMap, cell: Cell) -> f32 {
    let height_m = heights.height(cell).map_or(OUTSIDE_HEIGHT_M, |Metres(height_m)| height_m);
    height_m / HEIGHT_SCALE_M
}

/// Draws the maps of scenes in one city.
#[derive(Clone, Debug)]
pub struct Maps {
    heights: HeightMap,
    /// Sums of the heights (m) of all cells south-west of a corner: `[height + 1][width + 1]`.
    sums_m: Vec<u32>,
}

impl Maps {
    fn new(heights: &HeightMap) -> Maps {
        let (width, height) = (usize::from(heights.grid().width()), usize::from(heights.grid().height()));
        let mut sums_m = vec![0; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = 0;
            for x in 0..width {
                row += u32::from(heights.height_m(Cell::new(x as i16, y as i16)).unwrap_or(0));
                sums_m[(y + 1) * (width + 1) + x + 1] = sums_m[y * (width + 1) + x + 1] + row;
            }
        }
        Maps { heights: heights.clone(), sums_m }
    }

    /// The normalised mean height of a window.
    fn mean_height(&self, south_west: Cell) -> f32 {
        let grid = self.heights.grid();
        let (width, height) = (i32::from(grid.width()), i32::from(grid.height()));
        let ends = |first: i16, size: i32| {
            let first = i32::from(first);
            (first.clamp(0, size) as usize, (first + i32::from(WINDOW)).clamp(0, size) as usize)
        };
        let ((west, east), (south, north)) = (ends(south_west.x, width), ends(south_west.y, height));
        let sum = |x: usize, y: usize| self.sums_m[y * (width as usize + 1) + x];
        let inside_m = sum(east, north) + sum(west, south) - sum(west, north) - sum(east, south);
        let outside = GLOBAL_WINDOW * GLOBAL_WINDOW - (east - west) * (north - south);
        CELL_SHARE * (inside_m as f32 + outside as f32 * OUTSIDE_HEIGHT_M) / HEIGHT_SCALE_M
    }

    /// Draws the local map of a scene; `local` must be zero.
    pub(crate) fn draw_local(&self, scene: &Scene, local: &mut LocalMap) {
        for (index, cell) in local.chunks_exact_mut(MAP_CHANNELS).enumerate() {
            cell[HEIGHTS] = height(&self.heights, local_cell(scene.uav, index));
        }
        scene.marks(|cell, layer, value| {
            let (x, y) = (cell.x - scene.uav.x + LOCAL_REACH, cell.y - scene.uav.y + LOCAL_REACH);
            let side = LOCAL_SIDE as i16;
            if (0..side).contains(&x) && (0..side).contains(&y) {
                local[(y as usize * LOCAL_SIDE + x as usize) * MAP_CHANNELS + layer] += value;
            }
        });
    }

    /// Draws the global map of a scene; `global` must be zero.
    fn draw_global(&self, scene: &Scene, global: &mut GlobalMap) {
        let uav = scene.uav;
        let (west, south) =
            (uav.x - WINDOW / 2 - GLOBAL_MIDDLE.0 * WINDOW, uav.y - WINDOW / 2 - GLOBAL_MIDDLE.1 * WINDOW);
        for (index, cell) in global.chunks_exact_mut(MAP_CHANNELS).enumerate() {
            let (east, north) = ((index % GLOBAL_SIZE.0) as i16, (index / GLOBAL_SIZE.0) as i16);
            cell[HEIGHTS] = self.mean_height(Cell::new(west + east * WINDOW, south + north * WINDOW));
        }
        scene.marks(|cell, layer, value| {
            let window = |offset: i16, middle: i16| (offset + WINDOW / 2).div_euclid(WINDOW) + middle;
            let (x, y) = (window(cell.x - uav.x, GLOBAL_MIDDLE.0), window(cell.y - uav.y, GLOBAL_MIDDLE.1));
            if (0..GLOBAL_SIZE.0 as i16).contains(&x) && (0..GLOBAL_SIZE.1 as i16).contains(&y) {
                let window = y as usize * GLOBAL_SIZE.0 + x as usize;
                global[window * MAP_CHANNELS + layer] += CELL_SHARE * value;
            }
        });
    }
}

/// The cell at this place of the local map around the aircraft, south-west first, row by row.
pub(crate) fn local_cell(uav: Cell, index: usize) -> Cell {
    let (east, north) = ((index % LOCAL_SIDE) as i16, (index / LOCAL_SIDE) as i16);
    Cell::new(uav.x + east - LOCAL_REACH, uav.y + north - LOCAL_REACH)
}

impl Encoding for Maps {
    type Observation = Scene;
    type Network = MapShape;
    const MOSAC_NAME: &'static str = "mosac-cgl";
    const DDQN_NAME: &'static str = "ddqn-cgl";

    fn of(city: &City) -> Maps {
        Maps::new(city.heights())
    }

    fn observe(&self, flight: &Flight) -> Scene {
        Scene::of(flight)
    }

    fn push(&self, scene: &Scene, preferences: &[Preference], batch: &mut MapBatch) {
        let preferences: Vec<_> = preferences.iter().copied().map(weights).collect();
        let (local, global) = batch.push(schema::BATTERY.apply(scene.battery_units), &preferences);
        self.draw_local(scene, local);
        self.draw_global(scene, global);
    }

    fn distance_to_terminal(scene: &Scene) -> f32 {
        scene.battery_units - scene.spare_units
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_world::{Realization, ScenarioKind, Seed, World};
    use std::sync::Arc;

    /// Every layer of all 75 x 55 cells of the global map, computed cell by cell.
    fn reference_layers(world: &World, scene: &Scene) -> Vec<[f32; MAP_CHANNELS]> {
        let mut cells = Vec::new();
        for north in -27..=27 {
            for east in -37..=37 {
                let cell = Cell::new(scene.uav.x + east, scene.uav.y + north);
                let height_m = world.city().heights().height(cell).map_or(50.0, |height| height.0);
                let zone =
                    if cell == scene.terminal { -1.0 } else { f32::from(u8::from(cell == scene.start)) };
                let data: f32 = scene.devices.iter().filter(|d| d.0 == cell).map(|d| d.1 / 8000.0).sum();
                cells.push([height_m / 50.0, zone, data, f32::from(u8::from(cell == scene.uav))]);
            }
        }
        cells
    }

    fn scenes(world: &Arc<World>) -> Vec<Scene> {
        let maps = Maps::of(world.city());
        let mut scenes = Vec::new();
        for kind in ScenarioKind::ALL {
            let seed = Seed::evaluation(3);
            let realization = Realization::draw(world.city(), &kind.scenario(), seed).unwrap();
            let flight = Flight::new(world, &realization, seed, Preference::DATA).unwrap();
            let scene = maps.observe(&flight);
            for uav in [scene.uav, Cell::new(0, 0), Cell::new(39, 29), Cell::new(0, 17)] {
                scenes.push(Scene { uav, ..scene.clone() });
            }
        }
        scenes
    }

    #[test]
    fn maps_match_a_cell_by_cell_reference() {
        let world = Arc::new(World::default_world());
        let maps = Maps::of(world.city());
        for scene in scenes(&world) {
            let cells = reference_layers(&world, &scene);
            let mut batch = MapBatch::default();
            maps.push(&scene, &[Preference::DATA], &mut batch);
            let (local, global) = batch.last().unwrap();
            for (index, found) in local.as_chunks::<MAP_CHANNELS>().0.iter().enumerate() {
                let (x, y) = (37 - 5 + index % 10, 27 - 5 + index / 10);
                assert_eq!(*found, cells[y * 75 + x], "{scene:?} local {index}");
            }
            for (index, found) in global.as_chunks::<MAP_CHANNELS>().0.iter().enumerate() {
                let (x, y) = (5 * (index % 15), 5 * (index / 15));
                for (channel, found) in found.iter().enumerate() {
                    let window = (0..25).map(|i| cells[(y + i / 5) * 75 + x + i % 5][channel]);
                    let mean = window.sum::<f32>() / 25.0;
                    assert!(
                        (found - mean).abs() < 1e-5,
                        "{scene:?} global {index}, {channel}: {found}, {mean}"
                    );
                }
            }
        }
    }
}
