//! Numbers in sentences, without the formatting of `core`.

use core::fmt;

/// A number in plain decimal notation with up to three decimal places, rounded half to even as `core` does; with `{:#}` a
/// fraction of zero is left out. What is no number, or beyond a thousand million, is a dash.
///
/// The formatting of floats in `core` is exact for every number there is, takes 10 KB of flash, and can panic as far
/// as a linker can tell; the sentences of the aircraft need neither.
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
    fn it_is_what_core_writes() {
        for step in -2000..2000 {
            let number = step as f32 * 0.037;
            assert_eq!(Decimal::<1>(number).to_string(), format!("{number:.1}").replace("-0.0", "0.0"));
            assert_eq!(Decimal::<2>(number).to_string(), format!("{number:.2}").replace("-0.00", "0.00"));
        }
        assert_eq!(Decimal::<0>(99.6).to_string(), "100");
    }

    #[test]
    fn what_is_not_needed_is_left_out_and_what_is_no_number_is_a_dash() {
        assert_eq!(format!("{:#}..{:#}", Decimal::<1>(0.5), Decimal::<1>(10.0)), "0.5..10");
        assert_eq!(Decimal::<2>(f32::NAN).to_string(), "-");
        assert_eq!(Decimal::<2>(f32::INFINITY).to_string(), "-");
        assert_eq!(Decimal::<2>(1e9).to_string(), "1000000000.00");
    }
}
