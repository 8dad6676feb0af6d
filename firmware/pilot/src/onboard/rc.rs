//! The preference from a knob on the aircraft pilot's transmitter (`GLN_W_RC`).

/// Pulses of the two ends of a knob, microseconds.
const LOW_US: f32 = 1000.0;
const HIGH_US: f32 = 2000.0;
/// Anything outside is no knob: a receiver without a signal, a channel that is not mapped.
const PLAUSIBLE_US: core::ops::RangeInclusive<u16> = 800..=2200;
/// Turning the knob by less changes nothing: receivers jitter by a few microseconds, and every change is
/// announced to the operator.
const DEAD_BAND: f32 = 0.03;

/// Follows one knob.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Knob {
    applied: Option<f32>,
}

impl Knob {
    /// The weight of data that the knob now asks for, if it was turned since the last answer. The first pulse is
    /// an answer too: a knob shows what it is set to. Between turns a `PARAM_SET` or a command holds.
    pub(crate) fn turned(&mut self, pulse_us: Option<u16>) -> Option<f32> {
        let pulse_us = pulse_us.filter(|pulse_us| PLAUSIBLE_US.contains(pulse_us))?;
        let mut weight = ((f32::from(pulse_us) - LOW_US) / (HIGH_US - LOW_US)).clamp(0.0, 1.0);
        // The ends must be reachable with a transmitter whose knob stops a little short of them.
        if weight < DEAD_BAND {
            weight = 0.0;
        } else if weight > 1.0 - DEAD_BAND {
            weight = 1.0;
        }
        if self.applied.is_some_and(|applied| (weight - applied).abs() < DEAD_BAND) {
            return None;
        }
        self.applied = Some(weight);
        Some(weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_knob_maps_its_travel_to_the_weight_and_jitter_to_nothing() {
        let mut knob = Knob::default();
        assert_eq!(knob.turned(None), None);
        assert_eq!(knob.turned(Some(0)), None, "no signal");
        assert_eq!(knob.turned(Some(1500)), Some(0.5));
        for jitter_us in [1497, 1503, 1490, 1510, 1529] {
            assert_eq!(knob.turned(Some(jitter_us)), None);
        }
        assert_eq!(knob.turned(Some(1540)), Some(0.54));
        assert_eq!(knob.turned(Some(1985)), Some(1.0));
        assert_eq!(knob.turned(Some(2100)), None, "still the upper end");
        assert_eq!(knob.turned(Some(990)), Some(0.0));
    }
}
