//! The observation contract: every number that enters the model, with its unit, scale and meaning when absent.
//!
//! [`hash`] over this table is stored in each model. A runtime whose table differs refuses the model, so the
//! table cannot drift apart between the trainer and an aircraft.

/// One number of a token.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feature {
    /// The ONNX input that holds it.
    pub tensor: &'static str,
    /// Position within the token.
    pub index: usize,
    /// Its name.
    pub name: &'static str,
    /// The physical unit in which it enters the graph.
    pub unit: &'static str,
    /// How the graph normalises it.
    pub normalisation: Normalisation,
    /// What the number is when the quantity is not known.
    pub when_absent: &'static str,
}

/// `((x + shift) / scale)`, clipped to `[low, high]`: done inside the graph, stated here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalisation {
    /// Added first, in the physical unit.
    pub shift: f32,
    /// Divided by then, in the physical unit.
    pub scale: f32,
    /// Lower clip, normalised; minus infinity for none.
    pub low: f32,
    /// Upper clip, normalised; infinity for none.
    pub high: f32,
}

impl Normalisation {
    const fn scale(scale: f32) -> Normalisation {
        Normalisation { shift: 0.0, scale, low: f32::NEG_INFINITY, high: f32::INFINITY }
    }

    /// The number that the network's first layer sees.
    #[must_use]
    pub fn apply(&self, physical: f32) -> f32 {
        let normal = (physical + self.shift) / self.scale;
        // `clamp` would have to panic on a low above a high.
        if normal < self.low {
            self.low
        } else if normal > self.high {
            self.high
        } else {
            normal
        }
    }
}

/// Battery numbers: battery units / 40.
pub const BATTERY: Normalisation = Normalisation::scale(40.0);
/// Offsets, the same on both axes: metres / 400.
pub const OFFSET: Normalisation = Normalisation::scale(400.0);
/// Remaining data: data units / 8000, the largest initial load.
pub const REMAINING: Normalisation = Normalisation::scale(8000.0);
/// SNR: (dB + 8) / 13, clipped to [-2, 2.7]; median -16 dB and maximum 21.5 dB in the default city.
pub const SNR: Normalisation = Normalisation { shift: 8.0, scale: 13.0, low: -2.0, high: 2.7 };
/// Numbers that are near one already.
pub const PLAIN: Normalisation = Normalisation::scale(1.0);
/// Yields: data units / 6400.
pub const YIELD: Normalisation = Normalisation::scale(6400.0);

/// The SNR that stands for "not heard": normalised, the lower clip.
pub const SNR_NOT_HEARD_DB: f32 = -34.0;
/// Yields come in steps of so many data units, at most 255 of them.
pub const YIELD_STEP_UNITS: u16 = 64;
/// What stands in the local map for the terminal, if it is one of the eight cells around: a move there ends the mission.
pub const TERMINAL_UNITS: f32 = -6400.0;
/// SNR from which on a device's data flows (paper, Sigma), so that it counts as reachable.
pub const REACHABLE_SNR_DB: f32 = 5.0;

const NEVER: &str = "never absent";

const fn feature(
    tensor: &'static str,
    index: usize,
    name: &'static str,
    unit: &'static str,
    normalisation: Normalisation,
    when_absent: &'static str,
) -> Feature {
    Feature { tensor, index, name, unit, normalisation, when_absent }
}

/// The table. The local map is one row: its patches are alike, `north * 9 + east` with the nine bands of each axis.
pub const FEATURES: [Feature; 14] = [
    feature("uav", 0, "spare_battery", "battery units", BATTERY, NEVER),
    feature("uav", 1, "battery", "battery units", BATTERY, NEVER),
    feature("uav", 2, "terminal_east", "m", OFFSET, NEVER),
    feature("uav", 3, "terminal_north", "m", OFFSET, NEVER),
    feature("devices", 0, "device_east", "m", OFFSET, "row of zeros, masked"),
    feature("devices", 1, "device_north", "m", OFFSET, "row of zeros, masked"),
    feature("devices", 2, "remaining", "data units", REMAINING, "last known, at first the mission's"),
    feature("devices", 3, "snr", "dB", SNR, "-34 when not heard or stale"),
    feature("devices", 4, "reachable", "0 or 1", PLAIN, "0 when not heard or stale"),
    feature("devices", 5, "vantage_east", "m", OFFSET, "row of zeros, masked"),
    feature("devices", 6, "vantage_north", "m", OFFSET, "row of zeros, masked"),
    feature("preference", 0, "w_data", "1", PLAIN, NEVER),
    feature("preference", 1, "w_energy", "1", PLAIN, NEVER),
    feature("local_map", 0, "yield_of_10_slots", "data units", YIELD, "0 outside, -6400 terminal beside"),
];

/// The normalisations of one tensor, in index order.
pub fn normalisations(tensor: &str) -> impl Iterator<Item = Normalisation> {
    FEATURES.iter().filter(move |feature| feature.tensor == tensor).map(|feature| feature.normalisation)
}

/// FNV-1a (64 bit) over the table, the token counts and the action order: the model's `schema_hash`. Written down,
/// and worked out by a test, because only a host can print the table.
const HASH: u64 = 0xff6a_aa16_11c3_177f;

/// The hash of this program's contract.
#[must_use]
pub const fn hash() -> u64 {
    HASH
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{K_MAX, LOCAL_MAP_SIDE, TOKENS};
    use core::fmt::{self, Write};

    struct Fnv1a(u64);

    impl Write for Fnv1a {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            for byte in text.bytes() {
                self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
            Ok(())
        }
    }

    #[test]
    fn the_contract_changes_only_on_purpose() {
        let mut text = Fnv1a(0xcbf2_9ce4_8422_2325);
        // Writing into a hash cannot fail.
        let _ = write!(text, "{FEATURES:?} {K_MAX} {LOCAL_MAP_SIDE} {TOKENS} {REACHABLE_SNR_DB:?}");
        for action in gleaner_units::Action::ALL {
            let _ = write!(text, " {}", action.name());
        }
        // A new value means that every model trained before is refused: that must be a decision.
        assert_eq!(hash(), text.0, "schema hash is {:#018x}", text.0);
    }

    #[test]
    fn indices_count_up_within_each_tensor() {
        for pair in FEATURES.windows(2) {
            let same = pair[0].tensor == pair[1].tensor;
            assert_eq!(pair[1].index, if same { pair[0].index + 1 } else { 0 });
        }
    }

    #[test]
    fn not_heard_is_the_lower_clip() {
        assert_eq!(SNR.apply(SNR_NOT_HEARD_DB), SNR.low);
        assert_eq!(SNR.apply(100.0), 2.7);
        assert_eq!(SNR.apply(5.0), 1.0);
    }
}
