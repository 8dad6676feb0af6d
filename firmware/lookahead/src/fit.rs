//! The channel, estimated in flight from live SNR.
//!
//! The deviation from the nominal channel has four parameters: for each link condition a gain at 100 m and a change of
//! the path-loss exponent. A noise or gain offset changes both gains alike, so the prior correlates them. A Kalman filter
//! (recursive least squares with a prior) updates the parameters with every report. Outliers get less weight (Huber), and
//! a fifth number, the excess variance of the residuals, widens the distribution where the channel varies more than the
//! nominal shadowing, for example under fading.

use crate::ChannelModel;
use gleaner_policy::ChannelOffset;
use serde::{Deserialize, Serialize};

const PARAMETERS: usize = 4;
/// Distance at which the gains are estimated, decimal logarithm of metres: 100 m.
const REFERENCE_LOG10_M: f32 = 2.0;
/// The network's tokens keep the nominal channel until the estimated SNR is lower by this, dB, at 60 m or at 250 m: the network
/// is trained with the nominal one, and the noise of the estimate must not disturb it.
const TOKENS_KEEP_DB: f32 = 2.0;
const TOKENS_LOG10_M: [f32; 2] = [1.778, 2.398];
/// Mean of the square of a standard normal number, clipped at 1.
const CLIPPED_NORMAL: f32 = 0.516;

/// Constants of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// Prior standard deviation of the gain that both link conditions share, dB.
    pub shared_gain_db: f32,
    /// Prior standard deviation of each link condition's own gain, dB.
    pub own_gain_db: f32,
    /// Prior standard deviation of the exponent's change that both link conditions share.
    pub shared_exponent: f32,
    /// Prior standard deviation of each link condition's own change of the exponent.
    pub own_exponent: f32,
    /// Growth of the variance of each gain per slot, dB^2: lets the fit follow a slow change.
    pub gain_drift_db2: f32,
    /// Normalised residual from which on a report gets less weight (Huber).
    pub outlier: f32,
    /// Reports that the prior of the excess variance counts as.
    pub variance_reports: f32,
    /// Reports over which the excess variance is averaged at most.
    pub variance_memory: f32,
    /// Excess standard deviation, dB, from which on the model does not explain what is received.
    pub excess_max_db: f32,
}

impl FitSettings {
    /// Offsets of some decibels and exponents within 0.3 lie inside two standard deviations.
    pub const DEFAULT: FitSettings = FitSettings {
        shared_gain_db: 4.0,
        own_gain_db: 1.5,
        shared_exponent: 0.2,
        own_exponent: 0.1,
        gain_drift_db2: 0.002,
        outlier: 2.0,
        variance_reports: 10.0,
        variance_memory: 200.0,
        excess_max_db: 8.0,
    };
}

/// The deviation of the channel from the nominal one: the filter's state, to be logged and shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChannelFit {
    /// Gain at 100 m (dB) and change of the exponent, obstructed; the same with line of sight.
    mean: [f32; PARAMETERS],
    covariance: [[f32; PARAMETERS]; PARAMETERS],
    /// Variance of the residuals beyond the nominal shadowing, dB^2.
    excess_db2: f32,
    /// Reports that the excess variance is averaged over.
    reports: f32,
}

/// What a [`ChannelFit`] has found: the deviation from the nominal channel, obstructed links first, then links with line of
/// sight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelEstimate {
    /// Change of the gain at 100 m, dB.
    pub gain_db: [f32; 2],
    /// Change of the path-loss exponent.
    pub exponent: [f32; 2],
    /// Standard deviation of the residuals beyond the nominal shadowing, dB.
    pub excess_db: f32,
}

/// A report's prediction under one link condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prediction {
    pub snr_db: f32,
    pub variance_db2: f32,
}

impl Prediction {
    /// Logarithm of the likelihood of an SNR, up to a constant.
    pub fn log_likelihood(&self, snr_db: f32) -> f32 {
        let residual = snr_db - self.snr_db;
        -0.5 * (residual * residual / self.variance_db2 + libm::logf(self.variance_db2))
    }
}

impl Default for ChannelFit {
    fn default() -> ChannelFit {
        ChannelFit::new(&FitSettings::DEFAULT)
    }
}

impl ChannelFit {
    /// The nominal channel, with certainty.
    pub const NOMINAL: ChannelFit = ChannelFit {
        mean: [0.0; PARAMETERS],
        covariance: [[0.0; PARAMETERS]; PARAMETERS],
        excess_db2: 0.0,
        reports: 0.0,
    };

    /// The prior: the nominal channel.
    #[must_use]
    pub const fn new(settings: &FitSettings) -> ChannelFit {
        let gain = settings.shared_gain_db * settings.shared_gain_db;
        let own_gain = gain + settings.own_gain_db * settings.own_gain_db;
        let exponent = settings.shared_exponent * settings.shared_exponent;
        let own_exponent = exponent + settings.own_exponent * settings.own_exponent;
        ChannelFit {
            covariance: [
                [own_gain, 0.0, gain, 0.0],
                [0.0, own_exponent, 0.0, exponent],
                [gain, 0.0, own_gain, 0.0],
                [0.0, exponent, 0.0, own_exponent],
            ],
            ..ChannelFit::NOMINAL
        }
    }

    /// Mean SNR, dB, at a distance of `10^log10_m` metres in space.
    #[must_use]
    pub fn mean_snr_db(&self, channel: &ChannelModel, line_of_sight: bool, log10_m: f32) -> f32 {
        let row = regressors(line_of_sight, log10_m);
        channel.mean_snr_db(line_of_sight, log10_m) + dot(&row, &self.mean)
    }

    /// Standard deviation of the SNR in one slot around its mean, dB.
    #[must_use]
    pub fn deviation_db(&self, channel: &ChannelModel, line_of_sight: bool) -> f32 {
        libm::sqrtf(channel.path_loss(line_of_sight).shadowing_variance_db2 + self.excess_db2)
    }

    /// Gain offset at 100 m with line of sight, dB: the telemetry value `snr_off`.
    #[must_use]
    pub const fn offset_db(&self) -> f32 {
        let [_, _, gain, _] = self.mean;
        gain
    }

    /// Change of the exponents: obstructed, with line of sight.
    #[must_use]
    pub const fn exponents(&self) -> [f32; 2] {
        let [_, obstructed, _, line_of_sight] = self.mean;
        [obstructed, line_of_sight]
    }

    /// Standard deviation of the residuals beyond the nominal shadowing, dB.
    #[must_use]
    pub fn excess_db(&self) -> f32 {
        libm::sqrtf(self.excess_db2)
    }

    /// The fit without its uncertainty, for logs and telemetry.
    #[must_use]
    pub fn estimate(&self) -> ChannelEstimate {
        let [obstructed_gain, obstructed_exponent, gain, exponent] = self.mean;
        ChannelEstimate {
            gain_db: [obstructed_gain, gain],
            exponent: [obstructed_exponent, exponent],
            excess_db: self.excess_db(),
        }
    }

    /// The channel for the network's tokens: yield map and vantages count links with line of sight only. A channel near the
    /// nominal one or stronger, or a fit that is not trusted, counts as nominal.
    #[must_use]
    pub fn for_tokens(&self, settings: &FitSettings) -> ChannelOffset {
        let [_, _, gain_db, exponent] = self.mean;
        let is_weaker = TOKENS_LOG10_M
            .iter()
            .any(|&log10_m| dot(&regressors(true, log10_m), &self.mean) <= -TOKENS_KEEP_DB);
        if is_weaker && self.is_trusted(settings) {
            ChannelOffset { gain_db, exponent }
        } else {
            ChannelOffset::NONE
        }
    }

    /// Whether the model explains what is received.
    #[must_use]
    pub fn is_trusted(&self, settings: &FitSettings) -> bool {
        self.excess_db() < settings.excess_max_db
    }

    /// Lets a slot pass.
    pub fn advance(&mut self, settings: &FitSettings) {
        for (index, row) in self.covariance.iter_mut().enumerate() {
            if let Some(variance) = row.get_mut(index).filter(|_| index % 2 == 0) {
                *variance += settings.gain_drift_db2;
            }
        }
    }

    pub(crate) fn predict(&self, channel: &ChannelModel, line_of_sight: bool, log10_m: f32) -> Prediction {
        let row = regressors(line_of_sight, log10_m);
        let gain = self.covariance.map(|line| dot(&line, &row));
        Prediction {
            snr_db: channel.mean_snr_db(line_of_sight, log10_m) + dot(&row, &self.mean),
            variance_db2: dot(&gain, &row)
                + channel.path_loss(line_of_sight).shadowing_variance_db2
                + self.excess_db2,
        }
    }

    /// Takes one report. `weight` in 0..=1 is its information compared to an independent report: reports from one place
    /// share their shadowing.
    pub fn update(
        &mut self,
        settings: &FitSettings,
        channel: &ChannelModel,
        (line_of_sight, log10_m): (bool, f32),
        snr_db: f32,
        weight: f32,
    ) {
        if !(snr_db.is_finite() && log10_m.is_finite() && weight > 0.0) {
            return;
        }
        let row = regressors(line_of_sight, log10_m);
        let gain = self.covariance.map(|line| dot(&line, &row));
        let of_parameters = dot(&gain, &row);
        let shadowing = channel.path_loss(line_of_sight).shadowing_variance_db2;
        let noise = (shadowing + self.excess_db2) / weight;
        let residual = snr_db - self.mean_snr_db(channel, line_of_sight, log10_m);
        let ratio = libm::fabsf(residual) / libm::sqrtf(of_parameters + noise) / settings.outlier;
        // Huber: the influence of a report stops growing at the outlier limit.
        let variance = (of_parameters + noise) * ratio.max(1.0);
        for (mean, gain) in self.mean.iter_mut().zip(&gain) {
            *mean += gain * residual / variance;
        }
        for (line, a) in self.covariance.iter_mut().zip(&gain) {
            for (entry, b) in line.iter_mut().zip(&gain) {
                *entry -= a * b / variance;
            }
        }
        self.update_excess(settings, residual, of_parameters + shadowing);
    }

    /// Stochastic approximation of a robust variance: squared residuals are clipped at the present variance, so an outlier
    /// counts no more than one standard deviation.
    fn update_excess(&mut self, settings: &FitSettings, residual: f32, expected: f32) {
        self.reports = (self.reports + 1.0).min(settings.variance_memory);
        let variance = expected + self.excess_db2;
        let clipped = (residual * residual).min(variance) / CLIPPED_NORMAL;
        self.excess_db2 += (clipped - variance) / (self.reports + settings.variance_reports);
        self.excess_db2 = self.excess_db2.max(0.0);
    }
}

/// What the parameters contribute to the SNR.
fn regressors(line_of_sight: bool, log10_m: f32) -> [f32; PARAMETERS] {
    let slope = -10.0 * (log10_m - REFERENCE_LOG10_M);
    if line_of_sight { [0.0, 0.0, 1.0, slope] } else { [1.0, slope, 0.0, 0.0] }
}

fn dot(a: &[f32; PARAMETERS], b: &[f32; PARAMETERS]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;
    use rand_core::SeedableRng;
    use rand_xorshift::XorShiftRng;

    const SETTINGS: FitSettings = FitSettings::DEFAULT;
    const CHANNEL: ChannelModel = ChannelModel::NOMINAL;

    /// Reports over both link conditions, 80 m to 400 m, of a channel with this offset and change of the exponents.
    fn fitted(offset_db: f32, exponent: f32, reports: u32, noise: impl Fn(f32) -> f32) -> ChannelFit {
        let mut rng = XorShiftRng::seed_from_u64(1);
        let mut fit = ChannelFit::new(&SETTINGS);
        for number in 0..reports {
            let line_of_sight = number % 3 == 0;
            let log10_m = libm::log10f(80.0 + 320.0 * rng.unit());
            // The sum of four uniform numbers has a variance of 1/3.
            let normal = (rng.unit() + rng.unit() + rng.unit() + rng.unit() - 2.0) * 1.732;
            let deviation_db = CHANNEL.path_loss(line_of_sight).shadowing_variance_db2.sqrt();
            let mean_db = CHANNEL.mean_snr_db(line_of_sight, log10_m) + offset_db - 10.0 * exponent * log10_m;
            let snr_db = mean_db + deviation_db * normal + noise(rng.unit());
            fit.update(&SETTINGS, &CHANNEL, (line_of_sight, log10_m), snr_db, 1.0);
        }
        fit
    }

    fn error_db(fit: &ChannelFit, offset_db: f32, exponent: f32) -> f32 {
        let error = |line_of_sight: bool, log10_m: f32| {
            let truth = CHANNEL.mean_snr_db(line_of_sight, log10_m) + offset_db - 10.0 * exponent * log10_m;
            (fit.mean_snr_db(&CHANNEL, line_of_sight, log10_m) - truth).abs()
        };
        [(true, 1.9), (true, 2.4), (false, 2.0), (false, 2.5)]
            .map(|(z, d)| error(z, d))
            .into_iter()
            .fold(0.0, f32::max)
    }

    #[test]
    fn offset_and_exponents_are_found() {
        for (offset_db, exponent) in [(0.0, 0.0), (-6.0, 0.0), (6.0, 0.0), (0.0, 0.3), (0.0, -0.2)] {
            let few = fitted(offset_db, exponent, 12, |_| 0.0);
            assert!(error_db(&few, offset_db, exponent) < 2.5, "{offset_db} {exponent} {few:?}");
            let many = fitted(offset_db, exponent, 300, |_| 0.0);
            assert!(error_db(&many, offset_db, exponent) < 0.6, "{offset_db} {exponent} {many:?}");
            assert!(many.is_trusted(&SETTINGS) && many.excess_db() < 1.0, "{many:?}");
        }
    }

    #[test]
    fn tokens_follow_a_weaker_channel_only() {
        let tokens = |offset_db, exponent| fitted(offset_db, exponent, 300, |_| 0.0).for_tokens(&SETTINGS);
        for nominal in [tokens(0.0, 0.0), tokens(-1.0, 0.0), tokens(6.0, 0.0), tokens(0.0, -0.2)] {
            assert_eq!(nominal, ChannelOffset::NONE);
        }
        let weak = tokens(-6.0, 0.0);
        assert!((weak.gain_db + 6.0).abs() < 0.6 && weak.exponent.abs() < 0.1, "{weak:?}");
        let steep = tokens(0.0, 0.3);
        // At 100 m: 10 x 0.3 x 2 = 6 dB less.
        assert!((steep.gain_db + 6.0).abs() < 0.6 && (steep.exponent - 0.3).abs() < 0.1, "{steep:?}");
        let chaos = fitted(-6.0, 0.0, 300, |u| 80.0 * (u - 0.5));
        assert_eq!(chaos.for_tokens(&SETTINGS), ChannelOffset::NONE);
        assert_eq!(ChannelFit::NOMINAL.for_tokens(&SETTINGS), ChannelOffset::NONE);
    }

    #[test]
    fn a_tenth_of_outliers_does_not_move_the_fit() {
        let fit = fitted(-3.0, 0.0, 300, |u| if u < 0.1 { -25.0 } else { 0.0 });
        assert!(error_db(&fit, -3.0, 0.0) < 2.0, "{fit:?}");
    }

    #[test]
    fn excess_variance_shows_fading_and_chaos() {
        // Rayleigh fading: 20 log10 |h|, a standard deviation of 5.6 dB.
        let fading = fitted(0.0, 0.0, 300, |u| 10.0 * libm::log10f(-2.0 * libm::logf(1.0 - u)));
        assert!((2.5..8.0).contains(&fading.excess_db()), "{fading:?}");
        assert!(fading.is_trusted(&SETTINGS));
        let chaos = fitted(0.0, 0.0, 300, |u| 80.0 * (u - 0.5));
        assert!(!chaos.is_trusted(&SETTINGS), "{chaos:?}");
    }

    #[test]
    fn reports_that_are_not_numbers_change_nothing() {
        let mut fit = ChannelFit::new(&SETTINGS);
        for (log10_m, snr_db) in [(2.0, f32::NAN), (2.0, f32::NEG_INFINITY), (f32::NAN, 3.0)] {
            fit.update(&SETTINGS, &CHANNEL, (true, log10_m), snr_db, 1.0);
        }
        assert_eq!(fit, ChannelFit::new(&SETTINGS));
    }
}
