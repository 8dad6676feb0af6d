//! The observation contract: every number that enters the model, with its unit, scale and value when absent.
//!
//! Each model stores the [`hash`] of this table, and a program refuses a model with another hash. Trainer and aircraft
//! therefore always agree on the inputs.
//!
//! Feature counts and normalisation tables of trainer and engines are derived from [`FEATURES`]. To add a network
//! input: add its row here, its value in `Tokens::build`, and the new hash (the test prints it).

/// One number of a token.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feature {
    /// Name of the ONNX input.
    pub tensor: &'static str,
    /// Index within the token.
    pub index: usize,
    /// Name of the quantity.
    pub name: &'static str,
    /// Physical unit at the graph's input.
    pub unit: &'static str,
    /// How the graph normalises it.
    pub normalisation: Normalisation,
    /// Value when the quantity is unknown.
    pub when_absent: &'static str,
}

/// `((x + shift) / scale)` clipped to `[low, high]`. The graph computes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalisation {
    /// Added first, in the physical unit.
    pub shift: f32,
    /// Divisor, in the physical unit.
    pub scale: f32,
    /// Lower limit after scaling; minus infinity for none.
    pub low: f32,
    /// Upper limit after scaling; infinity for none.
    pub high: f32,
}

impl Normalisation {
    const fn scale(scale: f32) -> Normalisation {
        Normalisation { shift: 0.0, scale, low: f32::NEG_INFINITY, high: f32::INFINITY }
    }

    /// The input of the network's first layer.
    #[must_use]
    pub fn apply(&self, physical: f32) -> f32 {
        let normal = (physical + self.shift) / self.scale;
        // Not `clamp`: it panics when `low` exceeds `high`.
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
/// Offsets on both axes: metres / 400.
pub const OFFSET: Normalisation = Normalisation::scale(400.0);
/// Remaining data: data units / 8000, the largest initial load of the paper.
pub const REMAINING: Normalisation = Normalisation::scale(8000.0);
/// SNR: (dB + 8) / 13, clipped to [-2, 2.7]. In the default city the median is -16 dB and the maximum 21.5 dB.
pub const SNR: Normalisation = Normalisation { shift: 8.0, scale: 13.0, low: -2.0, high: 2.7 };
/// Numbers of order one: unchanged.
pub const PLAIN: Normalisation = Normalisation::scale(1.0);
/// Yields: data units / 6400.
pub const YIELD: Normalisation = Normalisation::scale(6400.0);

/// SNR of a device without a fresh report: the lower limit of [`SNR`].
pub const SNR_NOT_HEARD_DB: f32 = -34.0;
/// Resolution of the local map, data units; its largest value is 255 steps.
pub const YIELD_STEP_UNITS: u16 = 64;
/// Mark of the terminal in the local map when the terminal is one of the eight cells around the aircraft.
pub const TERMINAL_UNITS: f32 = -6400.0;
/// Lowest SNR at which a device can send (paper, Sigma): at and above it the device is reachable.
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

/// The table. One row describes all patches of the local map; patch `north * 9 + east` counts the nine bands of each
/// axis from the south-west.
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

/// Features of the aircraft's token.
pub const UAV_FEATURES: usize = feature_count("uav");
/// Features of one device's token.
pub const DEVICE_FEATURES: usize = feature_count("devices");
/// Features of the preference's token.
pub const PREFERENCE_FEATURES: usize = feature_count("preference");

/// Normalisations of the aircraft's token, in index order.
pub const UAV_NORMALISATIONS: [Normalisation; UAV_FEATURES] = table("uav");
/// Normalisations of a device's token, in index order.
pub const DEVICE_NORMALISATIONS: [Normalisation; DEVICE_FEATURES] = table("devices");
/// Normalisations of the preference's token, in index order.
pub const PREFERENCE_NORMALISATIONS: [Normalisation; PREFERENCE_FEATURES] = table("preference");

/// Rows of one tensor in [`FEATURES`].
const fn feature_count(tensor: &str) -> usize {
    let (mut rest, mut count): (&[Feature], usize) = (&FEATURES, 0);
    while let [first, tail @ ..] = rest {
        if is_same(first.tensor, tensor) {
            count += 1;
        }
        rest = tail;
    }
    count
}

#[expect(clippy::indexing_slicing, reason = "evaluated at compile time")]
const fn table<const N: usize>(tensor: &str) -> [Normalisation; N] {
    let (mut table, mut count) = ([PLAIN; N], 0);
    let mut rest: &[Feature] = &FEATURES;
    while let [first, tail @ ..] = rest {
        if is_same(first.tensor, tensor) {
            table[count] = first.normalisation;
            count += 1;
        }
        rest = tail;
    }
    table
}

/// `==` of strings in constants.
const fn is_same(a: &str, b: &str) -> bool {
    let (mut a, mut b) = (a.as_bytes(), b.as_bytes());
    while let ([first_a, rest_a @ ..], [first_b, rest_b @ ..]) = (a, b) {
        if *first_a != *first_b {
            return false;
        }
        (a, b) = (rest_a, rest_b);
    }
    a.is_empty() && b.is_empty()
}

/// The normalisations of one tensor, in index order.
pub fn normalisations(tensor: &str) -> impl Iterator<Item = Normalisation> {
    FEATURES.iter().filter(move |feature| feature.tensor == tensor).map(|feature| feature.normalisation)
}

/// FNV-1a (64 bit) over the table, the token counts and the action order: the model's `schema_hash`. A constant, because
/// formatting the table takes a host; a test recomputes it.
const HASH: u64 = 0xff6a_aa16_11c3_177f;

/// The hash of this program's observation contract.
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
    fn hash_matches_the_table() {
        let mut text = Fnv1a(0xcbf2_9ce4_8422_2325);
        // Writing into a hash cannot fail.
        let _ = write!(text, "{FEATURES:?} {K_MAX} {LOCAL_MAP_SIDE} {TOKENS} {REACHABLE_SNR_DB:?}");
        for action in gleaner_units::Action::ALL {
            let _ = write!(text, " {}", action.name());
        }
        // A new hash refuses every model trained before.
        assert_eq!(hash(), text.0, "schema hash is {:#018x}", text.0);
    }

    #[test]
    fn indices_are_consecutive_within_each_tensor() {
        for pair in FEATURES.windows(2) {
            let same = pair[0].tensor == pair[1].tensor;
            assert_eq!(pair[1].index, if same { pair[0].index + 1 } else { 0 });
        }
    }

    #[test]
    fn derived_tables_follow_the_features() {
        assert!(normalisations("uav").eq(UAV_NORMALISATIONS));
        assert!(normalisations("devices").eq(DEVICE_NORMALISATIONS));
        assert!(normalisations("preference").eq(PREFERENCE_NORMALISATIONS));
        assert!(normalisations("local_map").eq([YIELD]));
        assert!(!is_same("uav", "ua") && !is_same("ua", "uav") && is_same("uav", "uav"));
    }

    #[test]
    fn unheard_snr_is_the_lower_limit() {
        assert_eq!(SNR.apply(SNR_NOT_HEARD_DB), SNR.low);
        assert_eq!(SNR.apply(100.0), 2.7);
        assert_eq!(SNR.apply(5.0), 1.0);
    }
}
