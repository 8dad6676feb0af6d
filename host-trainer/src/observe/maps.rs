//! The centred local and global maps of the CGL systems (paper, section III-C; after Theile et al. 2021), painted
//! anew from what the replay memory keeps.
//!
//! Four layers, all seen from the aircraft: building heights; the zones, 1 at the start and -1 at the terminal (-1
//! where they are the same cell, which the paper leaves open); the data left at each device; the aircraft. Outside
//! the city the heights are the greatest, everything else is 0. The global map averages windows
//! of 5 x 5 cells, laid so that the aircraft is in the middle of the middle one: of the 79 x 59 cells that a centred
//! 40 x 30 city can span, 75 x 55 are seen, and the outermost two on each side are left out.

use crate::env::flight::Flight;
use crate::net::{
    GLOBAL_NUMBERS, GLOBAL_SIZE, GLOBAL_WINDOW, LOCAL_NUMBERS, LOCAL_SIDE, MAP_CHANNELS, MapBatch, MapShape,
};
use crate::observe::encoding::{Encoding, weights};
use crate::systems::System;
use gleaner_policy::{Preference, schema};
use gleaner_units::{Cell, HeightMap, Metres};
use gleaner_world::World;
use serde::{Deserialize, Serialize};

/// The layers of a map.
const HEIGHTS: usize = 0;
const ZONES: usize = 1;
const DATA: usize = 2;
const AIRCRAFT: usize = 3;

/// Cells west and south of the aircraft that the local map shows; one less east and north.
const LOCAL_REACH: i16 = (LOCAL_SIDE / 2) as i16;
/// Cells of the global map west and south of the aircraft's window.
const GLOBAL_MIDDLE: (i16, i16) = ((GLOBAL_SIZE.0 / 2) as i16, (GLOBAL_SIZE.1 / 2) as i16);
const WINDOW: i16 = GLOBAL_WINDOW as i16;
/// The height that stands for "outside the city", and the one that the network reads as 1.
const OUTSIDE_HEIGHT_M: f32 = 50.0;
const HEIGHT_SCALE_M: f32 = 50.0;
/// Share of a window's mean that one of its cells has.
const SHARE: f32 = 1.0 / (GLOBAL_WINDOW * GLOBAL_WINDOW) as f32;

/// What the replay memory keeps: about 100 bytes with six devices, where the painted maps are 4,240.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    uav: Cell,
    start: Cell,
    terminal: Cell,
    battery_units: f32,
    spare_units: f32,
    /// Where each device stands and what it holds, data units.
    devices: Vec<(Cell, f32)>,
}

/// The height of a cell as the paper's networks read it.
pub(crate) fn height(heights: &HeightMap, cell: Cell) -> f32 {
    let height_m = heights.height(cell).map_or(OUTSIDE_HEIGHT_M, |Metres(height_m)| height_m);
    height_m / HEIGHT_SCALE_M
}

/// Paints scenes of one city.
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

    /// The mean height of a window as the network reads it.
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
        SHARE * (inside_m as f32 + outside as f32 * OUTSIDE_HEIGHT_M) / HEIGHT_SCALE_M
    }

    fn paint_heights(&self, uav: Cell, local: &mut [f32; LOCAL_NUMBERS], global: &mut [f32; GLOBAL_NUMBERS]) {
        for (index, cell) in local.chunks_exact_mut(MAP_CHANNELS).enumerate() {
            cell[HEIGHTS] = height(&self.heights, local_cell(uav, index));
        }
        let (west, south) =
            (uav.x - WINDOW / 2 - GLOBAL_MIDDLE.0 * WINDOW, uav.y - WINDOW / 2 - GLOBAL_MIDDLE.1 * WINDOW);
        for (index, cell) in global.chunks_exact_mut(MAP_CHANNELS).enumerate() {
            let (east, north) = ((index % GLOBAL_SIZE.0) as i16, (index / GLOBAL_SIZE.0) as i16);
            cell[HEIGHTS] = self.mean_height(Cell::new(west + east * WINDOW, south + north * WINDOW));
        }
    }
}

/// The cell at this place of the local map around the aircraft, south-west first, row by row.
pub(crate) fn local_cell(uav: Cell, index: usize) -> Cell {
    let (east, north) = ((index % LOCAL_SIDE) as i16, (index / LOCAL_SIDE) as i16);
    Cell::new(uav.x + east - LOCAL_REACH, uav.y + north - LOCAL_REACH)
}

/// Adds a mark to the cell and to the window in which it lies, where the maps show them.
fn mark(
    (uav, cell): (Cell, Cell),
    channel: usize,
    value: f32,
    local: &mut [f32; LOCAL_NUMBERS],
    global: &mut [f32; GLOBAL_NUMBERS],
) {
    let (east, north) = (cell.x - uav.x, cell.y - uav.y);
    let (x, y) = (east + LOCAL_REACH, north + LOCAL_REACH);
    let side = LOCAL_SIDE as i16;
    if (0..side).contains(&x) && (0..side).contains(&y) {
        local[(y as usize * LOCAL_SIDE + x as usize) * MAP_CHANNELS + channel] += value;
    }
    let window = |offset: i16, middle: i16| (offset + WINDOW / 2).div_euclid(WINDOW) + middle;
    let (x, y) = (window(east, GLOBAL_MIDDLE.0), window(north, GLOBAL_MIDDLE.1));
    let (width, height) = (GLOBAL_SIZE.0 as i16, GLOBAL_SIZE.1 as i16);
    if (0..width).contains(&x) && (0..height).contains(&y) {
        global[(y as usize * GLOBAL_SIZE.0 + x as usize) * MAP_CHANNELS + channel] += SHARE * value;
    }
}

impl Encoding for Maps {
    type Observation = Scene;
    type Network = MapShape;
    const MOSAC: System = System::MosacCgl;

    fn of(world: &World) -> Maps {
        Maps::new(world.city().heights())
    }

    fn observe(&self, flight: &Flight) -> Scene {
        let episode = flight.episode();
        Scene {
            uav: episode.uav(),
            start: flight.start(),
            terminal: episode.terminal(),
            battery_units: episode.battery().0,
            spare_units: flight.spare().0,
            devices: episode.devices().iter().map(|device| (device.cell, device.remaining_units)).collect(),
        }
    }

    fn push(&self, seen: &Scene, preferences: &[Preference], batch: &mut MapBatch) {
        let preferences: Vec<_> = preferences.iter().copied().map(weights).collect();
        let (local, global) = batch.push(schema::BATTERY.apply(seen.battery_units), &preferences);
        self.paint_heights(seen.uav, local, global);
        if seen.start != seen.terminal {
            mark((seen.uav, seen.start), ZONES, 1.0, local, global);
        }
        mark((seen.uav, seen.terminal), ZONES, -1.0, local, global);
        for &(cell, remaining_units) in &seen.devices {
            let remaining = schema::REMAINING.apply(remaining_units);
            mark((seen.uav, cell), DATA, remaining, local, global);
        }
        mark((seen.uav, seen.uav), AIRCRAFT, 1.0, local, global);
    }

    fn way_to_terminal(seen: &Scene) -> f32 {
        seen.battery_units - seen.spare_units
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_world::{Realization, ScenarioKind, Seed};
    use std::sync::Arc;

    /// Every layer on all 75 x 55 cells that the global map shows.
    fn by_hand(world: &World, seen: &Scene) -> Vec<[f32; MAP_CHANNELS]> {
        let mut cells = Vec::new();
        for north in -27..=27 {
            for east in -37..=37 {
                let cell = Cell::new(seen.uav.x + east, seen.uav.y + north);
                let height_m = world.city().heights().height(cell).map_or(50.0, |height| height.0);
                let zone = if cell == seen.terminal { -1.0 } else { f32::from(u8::from(cell == seen.start)) };
                let data: f32 = seen.devices.iter().filter(|d| d.0 == cell).map(|d| d.1 / 8000.0).sum();
                cells.push([height_m / 50.0, zone, data, f32::from(u8::from(cell == seen.uav))]);
            }
        }
        cells
    }

    fn scenes(world: &Arc<World>) -> Vec<Scene> {
        let maps = Maps::of(world);
        let mut scenes = Vec::new();
        for kind in ScenarioKind::ALL {
            let seed = Seed::evaluation(3);
            let realization = Realization::draw(world.city(), &kind.scenario(), seed).unwrap();
            let flight = Flight::new(world, &realization, seed, Preference::DATA).unwrap();
            let seen = maps.observe(&flight);
            for uav in [seen.uav, Cell::new(0, 0), Cell::new(39, 29), Cell::new(0, 17)] {
                scenes.push(Scene { uav, ..seen.clone() });
            }
        }
        scenes
    }

    #[test]
    fn painted_maps_are_the_crop_and_the_window_means_of_the_whole_city() {
        let world = Arc::new(World::default_world());
        let maps = Maps::of(&world);
        for seen in scenes(&world) {
            let cells = by_hand(&world, &seen);
            let mut batch = MapBatch::default();
            maps.push(&seen, &[Preference::DATA], &mut batch);
            let (local, global) = batch.last().unwrap();
            for (index, found) in local.as_chunks::<MAP_CHANNELS>().0.iter().enumerate() {
                let (x, y) = (37 - 5 + index % 10, 27 - 5 + index / 10);
                assert_eq!(*found, cells[y * 75 + x], "{seen:?} local {index}");
            }
            for (index, found) in global.as_chunks::<MAP_CHANNELS>().0.iter().enumerate() {
                let (x, y) = (5 * (index % 15), 5 * (index / 15));
                for (channel, found) in found.iter().enumerate() {
                    let window = (0..25).map(|i| cells[(y + i / 5) * 75 + x + i % 5][channel]);
                    let mean = window.sum::<f32>() / 25.0;
                    assert!(
                        (found - mean).abs() < 1e-5,
                        "{seen:?} global {index}, {channel}: {found}, {mean}"
                    );
                }
            }
        }
    }
}
