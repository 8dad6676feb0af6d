//! Quantities as types. Elsewhere, the name of a raw number ends with its unit.

use core::ops::{Add, Mul, Neg, Sub};
use serde::{Deserialize, Serialize};

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub f32);

        impl Neg for $name {
            type Output = $name;
            fn neg(self) -> $name {
                $name(-self.0)
            }
        }
    };
}

macro_rules! additive {
    ($name:ident) => {
        impl Add for $name {
            type Output = $name;
            fn add(self, other: $name) -> $name {
                $name(self.0 + other.0)
            }
        }
        impl Sub for $name {
            type Output = $name;
            fn sub(self, other: $name) -> $name {
                $name(self.0 - other.0)
            }
        }
        impl Mul<f32> for $name {
            type Output = $name;
            fn mul(self, factor: f32) -> $name {
                $name(self.0 * factor)
            }
        }
    };
}

quantity!(
    /// A length.
    Metres
);
quantity!(
    /// An angle in degrees. Headings count clockwise from true north.
    Degrees
);
quantity!(
    /// A speed.
    MetresPerSecond
);
quantity!(
    /// A ratio of powers: a gain, a loss, an SNR.
    Db
);
quantity!(
    /// A power level relative to one milliwatt. The difference of two levels is a ratio; they have no sum.
    Dbm
);
quantity!(
    /// Energy, in units of one move by one cell.
    BatteryUnits
);

impl Degrees {
    /// The angle in radians.
    #[must_use]
    pub fn to_radians(self) -> f32 {
        self.0.to_radians()
    }
}

additive!(Metres);
additive!(MetresPerSecond);
additive!(Db);
additive!(BatteryUnits);

impl Add<Db> for Dbm {
    type Output = Dbm;
    fn add(self, gain: Db) -> Dbm {
        Dbm(self.0 + gain.0)
    }
}

impl Sub<Db> for Dbm {
    type Output = Dbm;
    fn sub(self, loss: Db) -> Dbm {
        Dbm(self.0 - loss.0)
    }
}

impl Sub for Dbm {
    type Output = Db;
    fn sub(self, other: Dbm) -> Db {
        Db(self.0 - other.0)
    }
}

/// ```compile_fail
/// use gleaner_units::Dbm;
/// let _ = Dbm(36.0) + Dbm(1.0); // levels have no sum
/// ```
#[allow(dead_code)]
struct LevelsDoNotAdd;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn link_budget_adds_up() {
        let received = Dbm(36.0) + Db(-96.0);
        let noise = Dbm(-60.0);
        let snr: Db = received - noise;
        assert_eq!(snr, Db(0.0));
        assert_eq!(BatteryUnits(80.0) - BatteryUnits(0.5) * 2.0, BatteryUnits(79.0));
    }
}
