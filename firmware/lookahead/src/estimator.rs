//! The channel of a mission, from the reports of all devices.

use crate::{ChannelEstimate, ChannelFit, ChannelModel, FitSettings};
use gleaner_policy::{ChannelOffset, DeviceState};
use gleaner_units::{Cell, Grid, Metres, Sight};

/// Information of the n-th report from one cell, compared to an independent one: `1 / (1 + n / REPORTS_PER_CELL)`.
const REPORTS_PER_CELL: f32 = 4.0;
/// Log-likelihood ratio from which on a report contradicts the map.
pub(crate) const CONTRADICTION: f32 = 4.0;
/// Information of a report that contradicts the map, compared to one that agrees with it.
const DOUBTFUL: f32 = 0.25;

/// Fits the channel to live SNR of up to `D` devices, slot by slot. It is all that a board without look-ahead needs.
#[derive(Clone, Debug)]
pub struct ChannelEstimator<const D: usize> {
    channel: ChannelModel,
    settings: FitSettings,
    fit: ChannelFit,
    cell: Option<Cell>,
    /// Slots in a row over the present cell.
    stay: u32,
    /// By device: SNR of the last report, dB, and the cell over which it was received; not a number before the first.
    last: [(f32, Cell); D],
}

/// A link as the map has it: with line of sight or not, and the decimal logarithm of its length in metres.
pub(crate) type Link = (bool, f32);

impl<const D: usize> ChannelEstimator<D> {
    /// The prior: this channel.
    #[must_use]
    pub const fn new(channel: ChannelModel, settings: FitSettings) -> ChannelEstimator<D> {
        let (fit, last) = (ChannelFit::new(&settings), [(f32::NAN, Cell::new(0, 0)); D]);
        ChannelEstimator { channel, settings, fit, cell: None, stay: 0, last }
    }

    /// Begins a mission: discards the fit.
    pub const fn begin(&mut self) {
        *self = ChannelEstimator::new(self.channel, self.settings);
    }

    /// The channel fit.
    #[must_use]
    pub const fn fit(&self) -> &ChannelFit {
        &self.fit
    }

    /// What the fit has found in this mission; `None` before the first slot.
    #[must_use]
    pub fn estimate(&self) -> Option<ChannelEstimate> {
        self.cell.map(|_| self.fit.estimate())
    }

    /// The prior.
    #[must_use]
    pub const fn channel(&self) -> &ChannelModel {
        &self.channel
    }

    /// Whether the model explains what is received.
    #[must_use]
    pub fn is_trusted(&self) -> bool {
        self.fit.is_trusted(&self.settings)
    }

    /// The channel for the network's tokens: see [`ChannelFit::for_tokens`].
    #[must_use]
    pub fn for_tokens(&self) -> ChannelOffset {
        self.fit.for_tokens(&self.settings)
    }

    /// Takes the reports of a slot over `cell`, of the same devices in the same order in every slot; the map decides line of
    /// sight.
    ///
    /// # Cost
    /// One ray for each device with a report.
    pub fn listen(&mut self, sight: &dyn Sight, cell: Cell, devices: impl IntoIterator<Item = DeviceState>) {
        self.arrive(cell);
        let (grid, altitude) = (sight.grid(), sight.altitude());
        if !grid.contains(cell) {
            return;
        }
        self.advance();
        for (index, device) in devices.into_iter().enumerate() {
            let Some(snr_db) = device.snr_db().filter(|&snr_db| self.is_from(index, snr_db, cell)) else {
                continue;
            };
            let link = (sight.sees(device.cell, cell), log10_m(grid, altitude, device.cell, cell));
            let doubt = self.doubt(link, snr_db);
            self.take(link, snr_db, doubt);
        }
    }

    /// A slot begins over this cell. Returns whether the aircraft was elsewhere before.
    pub(crate) fn arrive(&mut self, cell: Cell) -> bool {
        let moved = self.cell != Some(cell);
        self.stay = if moved { 0 } else { self.stay.saturating_add(1) };
        self.cell = Some(cell);
        moved
    }

    /// Lets the channel drift for a slot.
    pub(crate) fn advance(&mut self) {
        self.fit.advance(&self.settings);
    }

    /// Whether a device's report was received over this cell. A report counts as received for some seconds, and the aircraft
    /// flies on: an SNR with the same bits as over another cell is still the report from there.
    pub(crate) fn is_from(&mut self, device: usize, snr_db: f32, cell: Cell) -> bool {
        let Some(last) = self.last.get_mut(device) else { return true };
        if last.0 != snr_db {
            *last = (snr_db, cell);
        }
        last.1 == cell
    }

    /// How much better the other link condition explains an SNR: the logarithm of the likelihood ratio.
    pub(crate) fn doubt(&self, (line_of_sight, log10_m): Link, snr_db: f32) -> f32 {
        let [same, other] = [line_of_sight, !line_of_sight].map(|line_of_sight| {
            self.fit.predict(&self.channel, line_of_sight, log10_m).log_likelihood(snr_db)
        });
        other - same
    }

    /// Takes one report.
    pub(crate) fn take(&mut self, (line_of_sight, log10_m): Link, snr_db: f32, doubt: f32) {
        let weight = 1.0 / (1.0 + self.stay as f32 / REPORTS_PER_CELL);
        let (link, weight) = if doubt < CONTRADICTION {
            ((line_of_sight, log10_m), weight)
        } else {
            // The map is probably wrong here, but the report is not certain evidence of the other condition either.
            ((!line_of_sight, log10_m), weight * DOUBTFUL)
        };
        self.fit.update(&self.settings, &self.channel, link, snr_db, weight);
    }
}

/// Decimal logarithm of the distance in space, metres, between a device and an aircraft at this altitude.
pub(crate) fn log10_m(grid: Grid, altitude: Metres, device: Cell, aircraft: Cell) -> f32 {
    let (cell_m2, height_m2) = (grid.cell().0 * grid.cell().0, altitude.0 * altitude.0);
    let (dx, dy) = (device.x.abs_diff(aircraft.x), device.y.abs_diff(aircraft.y));
    let squared_cells = f32::from(dx) * f32::from(dx) + f32::from(dy) * f32::from(dy);
    0.5 * libm::log10f((squared_cells * cell_m2 + height_m2).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::{Db, HeightMap, Rays};

    #[test]
    fn reports_of_a_weak_channel_are_learned_within_one_way() {
        let mut heights = HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap());
        heights.set(Cell::new(12, 10), 50);
        let sight = Rays { heights: &heights, altitude_m: 60 };
        let mut estimator = ChannelEstimator::<2>::new(ChannelModel::NOMINAL, FitSettings::DEFAULT);
        let site = Cell::new(14, 10);
        let report = |cell: Cell, offset_db: f32| {
            let line_of_sight = sight.sees(site, cell);
            let snr_db = ChannelModel::NOMINAL
                .mean_snr_db(line_of_sight, log10_m(sight.grid(), sight.altitude(), site, cell));
            DeviceState { cell: site, remaining: 5000.0, snr: Some(Db(snr_db + offset_db)) }
        };
        for x in 5..20 {
            let cell = Cell::new(x, 10);
            let silent = DeviceState { snr: None, ..report(cell, 0.0) };
            estimator.listen(&sight, cell, [report(cell, -5.0), silent]);
        }
        let found = estimator.for_tokens();
        assert!((-6.0..-4.0).contains(&found.gain_db), "{found:?}");
        estimator.begin();
        assert_eq!(estimator.for_tokens(), ChannelOffset::NONE);
        estimator.listen(&sight, Cell::new(-1, 50), [report(Cell::new(5, 10), -20.0)]);
        let fresh = ChannelEstimator::<2>::new(ChannelModel::NOMINAL, FitSettings::DEFAULT);
        assert_eq!(estimator.fit(), fresh.fit());
    }

    /// A device falls silent while the aircraft flies towards it: its last report is from far away.
    #[test]
    fn a_held_report_is_one_piece_of_evidence() {
        let heights = HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap());
        let sight = Rays { heights: &heights, altitude_m: 60 };
        let site = Cell::new(20, 10);
        let log10_m = log10_m(sight.grid(), sight.altitude(), site, Cell::new(5, 10));
        let snr_db = ChannelModel::NOMINAL.mean_snr_db(true, log10_m);
        let held = DeviceState { cell: site, remaining: 5000.0, snr: Some(Db(snr_db)) };
        let mut estimator = ChannelEstimator::<1>::new(ChannelModel::NOMINAL, FitSettings::DEFAULT);
        for x in 5..15 {
            estimator.listen(&sight, Cell::new(x, 10), [held]);
        }
        assert_eq!(estimator.for_tokens(), ChannelOffset::NONE);
    }
}
