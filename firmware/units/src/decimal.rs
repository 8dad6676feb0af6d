//! Formatting of numbers without `core`'s float formatting.

use core::fmt;

/// A number in decimal notation with up to three places, rounded half to even like `core`. `{:#}` omits a zero fraction.
/// NaN, infinity and numbers beyond 1e12 / 10^`PLACES` are printed as a dash.
///
/// `core`'s float formatting takes 10 KB of flash and leaves panic paths in the image. Messages of the aircraft do not need
/// its precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decimal<const PLACES: usize>(pub f32);

impl<const PLACES: usize> fmt::Display for Decimal<PLACES> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const { assert!(PLACES <= 3) };
        let scale = const { 10_u64.pow(PLACES as u32) };
        let scaled = libm::rint(f64::from(self.0).abs() * scale as f64);
        if scaled.is_nan() || scaled >= 1e12 {
            return f.write_str("-");
        }
        let scaled = scaled as u64;
        let (whole, fraction) = (scaled / scale, scaled % scale);
        if self.0 < 0.0 && scaled > 0 {
            f.write_str("-")?;
        }
        if PLACES == 0 || (f.alternate() && fraction == 0) {
            write!(f, "{whole}")
        } else {
            write!(f, "{whole}.{fraction:0PLACES$}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{format, string::ToString};

    #[test]
    fn output_equals_that_of_core() {
        for step in -2000..2000 {
            let number = step as f32 * 0.037;
            assert_eq!(Decimal::<1>(number).to_string(), format!("{number:.1}").replace("-0.0", "0.0"));
            assert_eq!(Decimal::<2>(number).to_string(), format!("{number:.2}").replace("-0.00", "0.00"));
        }
        assert_eq!(Decimal::<0>(99.6).to_string(), "100");
    }

    #[test]
    fn zero_fractions_are_omitted_and_nan_is_a_dash() {
        assert_eq!(format!("{:#}..{:#}", Decimal::<1>(0.5), Decimal::<1>(10.0)), "0.5..10");
        assert_eq!(Decimal::<2>(f32::NAN).to_string(), "-");
        assert_eq!(Decimal::<2>(f32::INFINITY).to_string(), "-");
        assert_eq!(Decimal::<2>(1e9).to_string(), "1000000000.00");
    }
}
