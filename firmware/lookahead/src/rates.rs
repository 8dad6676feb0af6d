//! Expected data per slot, tabulated by distance and link condition.

use crate::{ChannelFit, ChannelModel};
use gleaner_units::{Grid, Metres};

/// Entries of the table, one for each ring of squared distance.
const RINGS: usize = 1024;
/// The table over mean SNR from which the rings are interpolated: first value, step, length.
const SNR_FROM_DB: f32 = -10.0;
const SNR_STEP_DB: f32 = 0.5;
const SNR_ENTRIES: usize = 96;
/// A change of the channel fit below this, dB, does not rebuild the table.
const REBUILD_DB: f32 = 0.1;
/// The two distances, as decimal logarithms of metres, at which a change of the fit is measured: 60 m and 300 m.
const REBUILD_LOG10_M: [f32; 2] = [1.778, 2.477];

/// Expected data units per slot by squared horizontal distance in cells, with and without line of sight.
///
/// Four kilobytes. Squared distances are whole numbers of cells, so the table is exact as long as the radio range is at
/// most 32 cells; for smaller cells, neighbouring squared distances share an entry.
#[derive(Clone, Debug)]
pub struct Rates {
    units: [[u16; RINGS]; 2],
    /// A ring holds `2^shift` squared distances.
    shift: u32,
    built_for: Option<[f32; 5]>,
}

impl Default for Rates {
    fn default() -> Rates {
        Rates::new()
    }
}

impl Rates {
    /// A table in which nothing is received.
    #[must_use]
    pub const fn new() -> Rates {
        Rates { units: [[0; RINGS]; 2], shift: 0, built_for: None }
    }

    /// Discards the channel, so that the next [`Rates::update`] rebuilds the table.
    pub const fn clear(&mut self) {
        self.built_for = None;
    }

    /// Rebuilds the table if the channel has changed noticeably; returns whether it has.
    ///
    /// # Cost
    /// About 25,000 exponentials and logarithms when it rebuilds.
    pub fn update(&mut self, channel: &ChannelModel, fit: &ChannelFit, grid: Grid, altitude: Metres) -> bool {
        let [near, far] = REBUILD_LOG10_M;
        let key = [
            fit.mean_snr_db(channel, true, near),
            fit.mean_snr_db(channel, true, far),
            fit.mean_snr_db(channel, false, near),
            fit.mean_snr_db(channel, false, far),
            fit.deviation_db(channel, false),
        ];
        let is_close = |built: [f32; 5]| built.iter().zip(&key).all(|(a, b)| (a - b).abs() < REBUILD_DB);
        if self.built_for.is_some_and(is_close) {
            return false;
        }
        self.built_for = Some(key);
        self.shift = shift(grid);
        let (cell_m2, height_m2) = (grid.cell().0 * grid.cell().0, altitude.0 * altitude.0);
        for (line_of_sight, units) in [false, true].into_iter().zip(&mut self.units) {
            let deviation_db = fit.deviation_db(channel, line_of_sight);
            let mut by_snr = [0.0; SNR_ENTRIES];
            for (index, units) in by_snr.iter_mut().enumerate() {
                let snr_db = SNR_FROM_DB + index as f32 * SNR_STEP_DB;
                *units = channel.expected_units_per_slot(snr_db, deviation_db);
            }
            for (ring, units) in units.iter_mut().enumerate() {
                let first = (ring as u32) << self.shift;
                let middle = first as f32 + 0.5 * ((1_u32 << self.shift) - 1) as f32;
                let log10_m = 0.5 * libm::log10f((middle * cell_m2 + height_m2).max(1.0));
                let snr_db = fit.mean_snr_db(channel, line_of_sight, log10_m);
                *units = interpolate(&by_snr, (snr_db - SNR_FROM_DB) / SNR_STEP_DB) as u16;
            }
        }
        true
    }

    /// Expected data units per slot.
    #[must_use]
    pub fn units_per_slot(&self, line_of_sight: bool, squared_cells: u32) -> u16 {
        let [obstructed, in_sight] = &self.units;
        let table = if line_of_sight { in_sight } else { obstructed };
        table.get((squared_cells >> self.shift) as usize).copied().unwrap_or(0)
    }
}

/// The smallest shift with which the table covers 640 m.
fn shift(grid: Grid) -> u32 {
    const RANGE_M: f32 = 640.0;
    let range_cells = RANGE_M / grid.cell().0;
    let mut shift = 0;
    while shift < 16 && range_cells * range_cells > (RINGS << shift) as f32 {
        shift += 1;
    }
    shift
}

/// Linear interpolation, rounded; 0 below the table, its last entry above.
fn interpolate(table: &[f32; SNR_ENTRIES], place: f32) -> f32 {
    if place.is_nan() || place < 0.0 {
        return 0.0;
    }
    let index = place as usize;
    match (table.get(index), table.get(index + 1)) {
        (Some(low), Some(high)) => low + (high - low) * (place - index as f32) + 0.5,
        _ => table.last().copied().unwrap_or(0.0) + 0.5,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rates(cell_m: f32) -> Rates {
        let mut rates = Rates::new();
        let grid = Grid::new(40, 30, Metres(cell_m)).unwrap();
        assert!(rates.update(&ChannelModel::NOMINAL, &ChannelFit::NOMINAL, grid, Metres(60.0)));
        assert!(!rates.update(&ChannelModel::NOMINAL, &ChannelFit::NOMINAL, grid, Metres(60.0)));
        rates
    }

    #[test]
    fn table_matches_the_formula() {
        let (rates, channel) = (rates(20.0), ChannelModel::NOMINAL);
        for squared_cells in [0_u32, 1, 25, 100, 250] {
            for line_of_sight in [false, true] {
                let log10_m = 0.5 * libm::log10f(squared_cells as f32 * 400.0 + 3600.0);
                let deviation_db = channel.path_loss(line_of_sight).shadowing_variance_db2.sqrt();
                let mean_db = channel.mean_snr_db(line_of_sight, log10_m);
                let expected = channel.expected_units_per_slot(mean_db, deviation_db);
                let tabulated = f32::from(rates.units_per_slot(line_of_sight, squared_cells));
                assert!((tabulated - expected).abs() <= 5.0, "{squared_cells}: {tabulated} {expected}");
            }
        }
        assert_eq!(rates.units_per_slot(true, u32::MAX), 0);
    }

    #[test]
    fn small_cells_share_entries_and_keep_the_range() {
        let rates = rates(5.0);
        // 200 m are 40 cells: SNR 7.9 dB.
        assert!(rates.units_per_slot(true, 1600) > 150);
        assert_eq!(rates.units_per_slot(true, 128 * 128), 0);
    }
}
