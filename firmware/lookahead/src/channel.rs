//! The nominal radio channel: path loss, shadowing, and what a slot carries.

/// Points of the quadrature over the shadowing, on each side of the mean.
const QUADRATURE_POINTS: i16 = 30;
/// Distance between them, standard deviations.
const QUADRATURE_STEP: f32 = 0.1;

/// Path loss and shadowing of one link condition (paper, table of simulation parameters).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLoss {
    /// alpha: the exponent of the distance.
    pub exponent: f32,
    /// Mean SNR at a distance of 1 m, dB: transmit power + beta - noise.
    pub snr_at_1m_db: f32,
    /// Variance of the shadowing, dB^2.
    pub shadowing_variance_db2: f32,
}

/// The nominal channel. [`ChannelModel::default`] has the constants of the simulated world: the paper's, with the noise
/// of -60 dBm that the paper leaves open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelModel {
    /// With line of sight.
    pub line_of_sight: PathLoss,
    /// Without.
    pub obstructed: PathLoss,
    /// Below this SNR, dB, a slot carries nothing.
    pub threshold_db: f32,
    /// Data units that a slot carries for each bit per second per hertz.
    pub slot_units: f32,
}

impl Default for ChannelModel {
    fn default() -> ChannelModel {
        ChannelModel::NOMINAL
    }
}

impl ChannelModel {
    /// The simulated world's.
    pub const NOMINAL: ChannelModel = ChannelModel {
        line_of_sight: PathLoss { exponent: 2.5, snr_at_1m_db: 66.0, shadowing_variance_db2: 2.0 },
        obstructed: PathLoss { exponent: 3.04, snr_at_1m_db: 61.0, shadowing_variance_db2: 5.0 },
        threshold_db: 5.0,
        slot_units: 100.0,
    };

    /// The constants of one link condition.
    #[must_use]
    pub const fn path_loss(&self, line_of_sight: bool) -> &PathLoss {
        if line_of_sight { &self.line_of_sight } else { &self.obstructed }
    }

    /// Mean SNR, dB, at a distance of `10^log10_m` metres in space.
    #[must_use]
    pub fn mean_snr_db(&self, line_of_sight: bool, log10_m: f32) -> f32 {
        let loss = self.path_loss(line_of_sight);
        loss.snr_at_1m_db - 10.0 * loss.exponent * log10_m
    }

    /// Data units that a slot carries at this SNR (paper, eq. 6).
    #[must_use]
    pub fn units_per_slot(&self, snr_db: f32) -> f32 {
        if snr_db >= self.threshold_db {
            self.slot_units * libm::log2f(1.0 + libm::exp10f(0.1 * snr_db))
        } else {
            0.0
        }
    }

    /// The mean of [`ChannelModel::units_per_slot`] over a normally distributed SNR.
    ///
    /// # Cost
    /// 61 evaluations of the rate: tabulate it.
    #[must_use]
    pub fn expected_units_per_slot(&self, mean_db: f32, deviation_db: f32) -> f32 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for point in -QUADRATURE_POINTS..=QUADRATURE_POINTS {
            let z = f32::from(point) * QUADRATURE_STEP;
            let weight = libm::expf(-0.5 * z * z);
            sum += weight * self.units_per_slot(mean_db + deviation_db * z);
            weights += weight;
        }
        sum / weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn above_a_device_a_slot_carries_717_units() {
        let channel = ChannelModel::NOMINAL;
        let snr_db = channel.mean_snr_db(true, libm::log10f(60.0));
        assert!((snr_db - 21.546).abs() < 0.001, "{snr_db}");
        assert!((channel.units_per_slot(snr_db) - 716.8).abs() < 0.2);
        assert!((channel.expected_units_per_slot(snr_db, 1.414) - 716.8).abs() < 0.6);
    }

    #[test]
    fn half_of_the_slots_at_the_threshold_carry_data() {
        let channel = ChannelModel::NOMINAL;
        assert_eq!(channel.units_per_slot(4.999), 0.0);
        let expected = channel.expected_units_per_slot(5.0, 1.414);
        assert!((100.0..135.0).contains(&expected), "{expected}");
    }
}
