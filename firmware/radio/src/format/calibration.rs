//! From a radio's SNR to the SNR that the policy was trained with.

use gleaner_units::Db;

/// SNR at which a LoRa demodulator just works, by spreading factor 5..12 (Semtech SX1276 datasheet, table 13, and
/// SX1262 datasheet, section 6.1.1.1): 2.5 dB less per step, -7.5 dB at SF7. `None` for other factors.
#[must_use]
pub fn required_snr(spreading_factor: u8) -> Option<Db> {
    (5..=12).contains(&spreading_factor).then(|| Db(-2.5 * (f32::from(spreading_factor) - 4.0)))
}

/// Straight line from a source's measure to the policy's SNR: `offset + slope * measure`.
///
/// The policy serves a device from 5 dB on (paper, table of simulation parameters). A source with another threshold is
/// shifted so that its own threshold becomes 5 dB; [`Calibration::LORA`] does so for the link margin of LoRa. To fit
/// a radio of your own, record its SNR at two distances in line of sight, and choose offset and slope so that both
/// agree with `66 dB - 25 log10(distance in m)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Added to the scaled measure.
    pub offset: Db,
    /// Factor of the measure.
    pub slope: f32,
}

impl Default for Calibration {
    fn default() -> Calibration {
        Calibration { offset: Db(0.0), slope: 1.0 }
    }
}

impl Calibration {
    /// For the link margin of LoRa, which is 0 dB where the demodulator just works.
    pub const LORA: Calibration = Calibration { offset: Db(5.0), slope: 1.0 };

    /// The policy's SNR.
    #[must_use]
    pub fn apply(&self, measure: Db) -> Db {
        Db(self.offset.0 + self.slope * measure.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lora_thresholds_are_those_of_the_datasheet() {
        let table = [(7, -7.5), (8, -10.0), (9, -12.5), (10, -15.0), (11, -17.5), (12, -20.0)];
        for (factor, snr_db) in table {
            assert_eq!(required_snr(factor), Some(Db(snr_db)), "SF{factor}");
        }
        assert_eq!([required_snr(4), required_snr(13)], [None, None]);
    }

    #[test]
    fn offset_and_slope_make_a_line() {
        let calibration = Calibration { offset: Db(3.0), slope: 0.5 };
        assert_eq!(calibration.apply(Db(-4.0)), Db(1.0));
        assert_eq!(Calibration::LORA.apply(Db(0.0)), Db(5.0));
    }
}
