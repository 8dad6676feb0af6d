//! The radio channel: path loss, shadowing, noise, and the data of one slot.

use crate::seed::{normal_pair, open_unit};
use gleaner_units::{Db, Dbm, Metres};
use rand::Rng;

/// Path loss and shadowing of one link condition (paper, table of simulation parameters).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLoss {
    /// alpha: the exponent of the distance.
    pub exponent: f32,
    /// beta: mean gain at a distance of 1 m.
    pub bias: Db,
    /// sigma^2: variance of the shadowing, dB^2.
    pub shadowing_variance_db2: f32,
}

/// Small-scale fading on top of the shadowing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fading {
    /// None: what the policy is trained with.
    #[default]
    None,
    /// 20 log10 |h| with |h| Rayleigh-distributed with scale 1 (paper, section V-C: the robustness test).
    Rayleigh,
}

/// The constants of the channel. [`Channel::default`] has the paper's values. The paper gives neither noise nor slot
/// capacity; the defaults reproduce its printed results.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channel {
    /// With line of sight: 2.5, -30 dB, 2 dB^2.
    pub line_of_sight: PathLoss,
    /// Without: 3.04, -35 dB, 5 dB^2.
    pub obstructed: PathLoss,
    /// P, transmit power: 36 dBm.
    pub transmit: Dbm,
    /// sigma^2, noise level: -60 dBm, as in the published code of an earlier form of this channel (Chen et al., model-aided
    /// federated reinforcement learning for UAV data harvesting).
    pub noise: Dbm,
    /// Sigma, threshold: below 5 dB there is no transmission.
    pub threshold: Db,
    /// kappa, bandwidth times slot length: 100 data units per slot for 1 bit/s/Hz.
    pub slot_units: f32,
    /// None by default.
    pub fading: Fading,
}

impl Default for Channel {
    fn default() -> Channel {
        Channel {
            line_of_sight: PathLoss { exponent: 2.5, bias: Db(-30.0), shadowing_variance_db2: 2.0 },
            obstructed: PathLoss { exponent: 3.04, bias: Db(-35.0), shadowing_variance_db2: 5.0 },
            transmit: Dbm(36.0),
            noise: Dbm(-60.0),
            threshold: Db(5.0),
            slot_units: 100.0,
            fading: Fading::None,
        }
    }
}

impl Channel {
    /// The constants of one link condition.
    #[must_use]
    pub const fn path_loss(&self, line_of_sight: bool) -> &PathLoss {
        if line_of_sight { &self.line_of_sight } else { &self.obstructed }
    }

    /// SNR of a link without shadowing and fading. `distance` is the length of the straight line in space.
    ///
    /// The paper prints the gain as `beta - alpha log10(d)`. Path loss in decibels needs `10 alpha`; without the 10, every
    /// link of the city would have about 50 dB.
    #[must_use]
    pub fn mean_snr(&self, line_of_sight: bool, distance: Metres) -> Db {
        let loss = self.path_loss(line_of_sight);
        let gain = loss.bias - Db(10.0 * loss.exponent * libm::log10f(distance.0));
        self.transmit + gain - self.noise
    }

    /// Data units of one slot at this SNR (paper, eq. 6); 0 below the threshold.
    #[must_use]
    pub fn data_per_slot(&self, snr: Db) -> f32 {
        if snr >= self.threshold {
            self.slot_units * libm::log2f(1.0 + libm::exp10f(0.1 * snr.0))
        } else {
            0.0
        }
    }

    /// The mean of [`Channel::data_per_slot`] over the shadowing, for planners that know the mean SNR. Without fading.
    ///
    /// # Cost
    /// A sum over 121 points: tabulate it.
    #[must_use]
    pub fn expected_data_per_slot(&self, line_of_sight: bool, mean: Db) -> f32 {
        let deviation_db = libm::sqrtf(self.path_loss(line_of_sight).shadowing_variance_db2);
        let (mut sum, mut weights) = (0.0, 0.0);
        for point in -60..=60_i16 {
            let z = f32::from(point) * 0.1;
            let weight = libm::expf(-0.5 * z * z);
            sum += weight * self.data_per_slot(mean + Db(deviation_db * z));
            weights += weight;
        }
        sum / weights
    }

    /// The SNR in one slot of two links, each given by its condition and its mean.
    pub(crate) fn draw_pair(&self, links: [(bool, Db); 2], rng: &mut impl Rng) -> [Db; 2] {
        let (first, second) = normal_pair(rng);
        [(links[0], first), (links[1], second)].map(|((line_of_sight, mean), normal)| {
            let deviation_db = libm::sqrtf(self.path_loss(line_of_sight).shadowing_variance_db2);
            mean + Db(deviation_db * normal) + self.draw_fading(rng)
        })
    }

    fn draw_fading(&self, rng: &mut impl Rng) -> Db {
        match self.fading {
            Fading::None => Db(0.0),
            // |h|^2 = -2 ln u.
            Fading::Rayleigh => Db(10.0 * libm::log10f(-2.0 * libm::logf(open_unit(rng)))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Seed, Stream};

    #[test]
    fn right_above_a_device_one_slot_brings_717_units() {
        let channel = Channel::default();
        let snr = channel.mean_snr(true, Metres(60.0));
        assert!((snr.0 - 21.546).abs() < 0.001, "{snr:?}");
        assert!((channel.data_per_slot(snr) - 716.8).abs() < 0.2, "{}", channel.data_per_slot(snr));
        assert!((channel.expected_data_per_slot(true, snr) - 716.8).abs() < 0.6);
    }

    #[test]
    fn no_data_below_the_threshold() {
        let channel = Channel::default();
        assert_eq!(channel.data_per_slot(Db(4.999)), 0.0);
        // 10^0.5 = 3.1623; log2(4.1623) = 2.0574.
        assert!((channel.data_per_slot(Db(5.0)) - 205.74).abs() < 0.01);
        // At the threshold half of the draws carry data.
        let expected = channel.expected_data_per_slot(true, Db(5.0));
        assert!((105.0..125.0).contains(&expected), "{expected}");
    }

    #[test]
    fn draws_have_the_documented_mean_and_variance() {
        let mut rng = Seed::training(3).rng(Stream::Slots);
        let mut statistics = |channel: Channel, line_of_sight: bool| {
            let draws: Vec<f64> = (0..100_000)
                .flat_map(|_| {
                    channel.draw_pair([(line_of_sight, Db(7.0)); 2], &mut rng).map(|snr| f64::from(snr.0))
                })
                .collect();
            let mean = draws.iter().sum::<f64>() / draws.len() as f64;
            (mean, draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / draws.len() as f64)
        };
        let (mean, variance) = statistics(Channel::default(), true);
        assert!((mean - 7.0).abs() < 0.02 && (variance - 2.0).abs() < 0.03, "{mean} {variance}");
        let (mean, variance) = statistics(Channel::default(), false);
        assert!((mean - 7.0).abs() < 0.02 && (variance - 5.0).abs() < 0.07, "{mean} {variance}");
        // 10 log10 of an exponential of mean 2: mean 10 log10(2) - 2.507 dB, variance 31.02 dB^2.
        let (mean, variance) = statistics(Channel { fading: Fading::Rayleigh, ..Channel::default() }, true);
        assert!((mean - 7.503).abs() < 0.06 && (variance - 33.02).abs() < 0.6, "{mean} {variance}");
    }
}
