//! The model of a mission under the true channel: which device is received where, and how fast.

use gleaner_lookahead::{EMPTY_UNITS, Model, Transmission};
use gleaner_units::{Cell, Db, Grid};
use gleaner_world::{Realization, World};
use rand::{Rng, RngExt};
use std::sync::Arc;

/// The rate table over mean SNR: step, first value, length. No link lies outside it that carries data.
const TABLE_STEP_DB: f32 = 0.25;
const TABLE_FROM_DB: f32 = -20.0;
const TABLE_LEN: usize = 240;
/// Links with a lower expected rate, data units per slot, are left out.
const AUDIBLE_UNITS: f32 = 1.0;

/// Expected data per slot of a link by its mean SNR, with and without line of sight.
#[derive(Debug)]
pub struct Rates {
    world: Arc<World>,
    tables: [Vec<f32>; 2],
}

impl Rates {
    /// Tabulates the channel of a world.
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

    /// The model of one mission, without fence and reserve.
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
        let mut sum = 0.0;
        let squared_rates = from
            .windows(2)
            .map(|ends| {
                let units: f32 =
                    audible[ends[0] as usize..ends[1] as usize].iter().map(|link| link.units).sum();
                sum += units * units;
                sum
            })
            .collect();
        Known {
            grid,
            squared_rates,
            audible,
            from,
            terminal: realization.terminal(),
            devices: realization.devices().iter().map(|device| device.cell).collect(),
            initial_units: realization.devices().iter().map(|device| device.data_units).sum(),
        }
    }
}

/// A device that is received over a cell.
#[derive(Clone, Copy, Debug)]
pub struct Audible {
    /// Its index.
    pub device: u8,
    /// Expected data units per slot.
    pub units: f32,
}

/// A mission whose only unknown is the shadowing of each slot.
#[derive(Clone, Debug)]
pub struct Known {
    grid: Grid,
    audible: Vec<Audible>,
    /// By cell: the start of its part of `audible`; one more entry than cells.
    from: Vec<u32>,
    /// By cell: the sum over all cells up to it of the squared total rate of all devices.
    squared_rates: Vec<f32>,
    terminal: Cell,
    devices: Vec<Cell>,
    initial_units: f32,
}

impl Known {
    /// The devices that are received over a cell, highest mean SNR first.
    #[must_use]
    pub fn audible(&self, cell: Cell) -> &[Audible] {
        let Some(place) = self.grid.index(cell) else { return &[] };
        &self.audible[self.from[place] as usize..self.from[place + 1] as usize]
    }
}

impl Model for Known {
    fn grid(&self) -> Grid {
        self.grid
    }

    fn terminal(&self) -> Cell {
        self.terminal
    }

    fn moves_home(&self, cell: Cell) -> Option<u16> {
        self.grid.contains(cell).then(|| cell.manhattan(self.terminal) as u16)
    }

    fn reserve_hovers(&self) -> i32 {
        0
    }

    fn devices(&self) -> &[Cell] {
        &self.devices
    }

    fn initial_units(&self) -> f32 {
        self.initial_units
    }

    fn transmission(&self, cell: Cell, remaining: &[f32]) -> Option<Transmission> {
        let has_data = |link: &&Audible| remaining[usize::from(link.device)] > EMPTY_UNITS;
        let link = self.audible(cell).iter().find(has_data)?;
        Some(Transmission { device: usize::from(link.device), units: link.units })
    }

    /// A random cell with a probability proportional to its squared total rate: good tours hover where several devices are
    /// in sight.
    fn draw_stop(&self, _remaining: &[f32], rng: &mut impl Rng) -> Cell {
        let total = self.squared_rates.last().copied().unwrap_or(0.0);
        let drawn = rng.random::<f32>() * total;
        let place = self.squared_rates.partition_point(|&sum| sum <= drawn);
        self.grid.cell_at(place).unwrap_or(self.terminal)
    }
}
