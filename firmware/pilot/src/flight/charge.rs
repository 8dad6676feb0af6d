//! The charge that was drawn, in percent of the battery finer than whole ones.
//!
//! MAVLink carries the charge left in whole percent, and the charge drawn in mAh. The monitor's capacity is not known
//! here, so the mAh of one percent are learned: between two steps of the percentage exactly that many percent were drawn.
//! Monitors that judge the percentage by voltage, and those that report no mAh, have no such relation; then the steps of
//! the percentage alone count ([`super::burn`]).

/// Percent that must have been seen before the mAh count.
const LEARNED_PERCENT: f32 = 4.0;
/// Weight of an older step per newer one.
const DECAY: f32 = 0.95;
/// A step whose mAh differ from the learned ones by more than this factor shows a percentage that follows the voltage.
const AGREES: f32 = 1.6;

/// The relation between mAh and percent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Charge {
    /// Sums over the steps of the percentage, decayed.
    percent: f32,
    mah: f32,
    /// mAh at the last step of the percentage.
    step_mah: Option<u32>,
}

impl Charge {
    pub(crate) const fn new() -> Charge {
        Charge { percent: 0.0, mah: 0.0, step_mah: None }
    }

    /// The percentage stepped down by `percent` while the monitor shows `mah` drawn.
    pub(crate) fn stepped(&mut self, percent: u8, mah: Option<u32>) {
        let last = core::mem::replace(&mut self.step_mah, mah);
        let Some(drawn) = last.zip(mah).and_then(|(last, mah)| mah.checked_sub(last)) else { return };
        let (percent, drawn) = (f32::from(percent), drawn as f32);
        if self.mah_per_percent().is_some_and(|learned| !agrees(drawn, learned * percent)) {
            *self = Charge { step_mah: mah, ..Charge::new() };
            return;
        }
        self.percent = self.percent * DECAY + percent;
        self.mah = self.mah * DECAY + drawn;
    }

    /// The percentage jumped: the interval since the last step has no exact start.
    pub(crate) fn jumped(&mut self) {
        self.step_mah = None;
    }

    /// mAh of one percent, once enough was seen.
    pub(crate) fn mah_per_percent(&self) -> Option<f32> {
        (self.percent >= LEARNED_PERCENT && self.mah > 0.0).then(|| self.mah / self.percent)
    }
}

fn agrees(a: f32, b: f32) -> bool {
    a <= AGREES * b && b <= AGREES * a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_capacity_is_learned_from_the_steps() {
        let mut charge = Charge::new();
        for step in 0..6_u32 {
            assert_eq!(charge.mah_per_percent(), None);
            charge.stepped(1, Some(1_000 + 33 * step));
        }
        assert!((charge.mah_per_percent().unwrap() - 33.0).abs() < 0.1);
    }

    #[test]
    fn a_percentage_that_follows_the_voltage_teaches_nothing() {
        let mut charge = Charge::new();
        let mut mah = 0;
        for drawn in [33, 33, 33, 33, 33, 33, 120, 4, 90] {
            mah += drawn;
            charge.stepped(1, Some(mah));
        }
        assert_eq!(charge.mah_per_percent(), None);
        charge.stepped(1, None);
        assert_eq!(charge.mah_per_percent(), None);
    }
}
