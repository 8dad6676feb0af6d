//! What there is to know about a mission: who is heard where, and how well.

use gleaner_units::{Cell, Db, Grid};
use gleaner_world::{Realization, World};
use rand::{Rng, RngExt};
use std::sync::Arc;

/// Steps of the rate table, and its range: below nothing is carried, above nothing lies.
const TABLE_STEP_DB: f32 = 0.25;
const TABLE_FROM_DB: f32 = -20.0;
const TABLE_LEN: usize = 240;
/// Links that carry less than this in the mean, data units per slot, are left out.
const AUDIBLE_UNITS: f32 = 1.0;

/// Expected data per slot of a link by its mean SNR, with and without line of sight.
#[derive(Debug)]
pub struct Rates {
    world: Arc<World>,
    tables: [Vec<f32>; 2],
}

impl Rates {
    /// Tabulates the channel.
    #[must_use]
    pub fn new(world: Arc<World>) -> Rates {
        let tables = [false, true].map(|line_of_sight| {
            (0..TABLE_LEN)
                .map(|index| {
                    let mean = Db(TABLE_FROM_DB + index as f32 * TABLE_STEP_DB);
                    world.channel().expected_data_per_slot(line_of_sight, mean)
                })
                .collect()
        });
        Rates { world, tables }
    }

    /// Mean SNR, dB, and expected data units per slot.
    pub(super) fn link(&self, device: Cell, uav: Cell) -> (f32, f32) {
        let snr_db = self.world.mean_snr(device, uav).map_or(f32::NEG_INFINITY, |snr| snr.0);
        let table = &self.tables[usize::from(self.world.city().line_of_sight(device, uav))];
        let index = ((snr_db - TABLE_FROM_DB) / TABLE_STEP_DB).round();
        (snr_db, if index < 0.0 { 0.0 } else { table[(index as usize).min(TABLE_LEN - 1)] })
    }

    /// Expected data units per slot.
    pub(super) fn units_per_slot(&self, device: Cell, uav: Cell) -> f32 {
        self.link(device, uav).1
    }

    /// The grid of the city.
    pub(super) fn grid(&self) -> Grid {
        self.world.city().grid()
    }

    /// Everything about one mission, without fence and reserve.
    #[must_use]
    pub fn study(&self, realization: &Realization) -> Known {
        let grid = self.world.city().grid();
        let (mut audible, mut from) = (Vec::new(), vec![0]);
        for uav in grid.cells() {
            let mut here: Vec<(f32, Audible)> = realization
                .devices()
                .iter()
                .enumerate()
                .map(|(index, device)| {
                    let (snr_db, units) = self.link(device.cell, uav);
                    (snr_db, Audible { device: index as u8, units })
                })
                .filter(|(_, link)| link.units >= AUDIBLE_UNITS)
                .collect();
            here.sort_by(|a, b| b.0.total_cmp(&a.0));
            audible.extend(here.into_iter().map(|(_, link)| link));
            from.push(audible.len() as u32);
        }
        let mut busyness = 0.0;
        let busyness = from
            .windows(2)
            .map(|ends| {
                let heard: f32 =
                    audible[ends[0] as usize..ends[1] as usize].iter().map(|link| link.units).sum();
                busyness += heard * heard;
                busyness
            })
            .collect();
        Known {
            grid,
            busyness,
            audible,
            from,
            terminal: realization.terminal(),
            devices: realization.devices().iter().map(|device| device.cell).collect(),
            initial_units: realization.devices().iter().map(|device| device.data_units).sum(),
        }
    }
}

/// A device that is heard at a cell.
#[derive(Clone, Copy, Debug)]
pub struct Audible {
    /// Its index.
    pub device: u8,
    /// What a slot carries from it in the mean.
    pub units: f32,
}

/// One mission with nothing hidden but the chance of each slot.
#[derive(Clone, Debug)]
pub struct Known {
    grid: Grid,
    audible: Vec<Audible>,
    /// Where the cell's part of `audible` begins; one more entry than cells.
    from: Vec<u32>,
    /// Up to and with each cell, the sum of the squares of what is heard there from all devices together.
    busyness: Vec<f32>,
    terminal: Cell,
    devices: Vec<Cell>,
    initial_units: f32,
}

impl Known {
    /// The grid of the city.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// The cell that ends the mission.
    #[must_use]
    pub const fn terminal(&self) -> Cell {
        self.terminal
    }

    /// Where the devices are.
    #[must_use]
    pub fn devices(&self) -> &[Cell] {
        &self.devices
    }

    /// What all devices held at the start.
    #[must_use]
    pub const fn initial_units(&self) -> f32 {
        self.initial_units
    }

    /// A random cell, the likelier the more is heard there: good tours hover where several devices are in sight.
    pub fn busy_cell(&self, rng: &mut impl Rng) -> Cell {
        let most = self.busyness.last().copied().unwrap_or(0.0);
        let drawn = rng.random::<f32>() * most;
        let place = self.busyness.partition_point(|&sum| sum <= drawn);
        self.grid.cell_at(place).unwrap_or(self.terminal)
    }

    /// The devices that are heard at a cell, the best in the mean first.
    #[must_use]
    pub fn audible(&self, cell: Cell) -> &[Audible] {
        let Some(place) = self.grid.index(cell) else { return &[] };
        &self.audible[self.from[place] as usize..self.from[place + 1] as usize]
    }
}
