//! Values of `PARAM_SET`, by their `MAV_PARAM_TYPE`.
//!
//! The field of the value is a float, and integers are put into it in two ways (MAVLink guide, "Parameter Protocol"):
//! PX4 copies the integer's bytes, ArduPilot converts the number. Ground stations follow the rule of the *autopilot*
//! for every component of its system. Our parameters are `REAL32`, which both encode alike, but a client may still send
//! an integer type. The two encodings do not overlap: the bytes of an integer below 2^23 are a subnormal float, those of
//! a negative one above -2^23 are NaN, and no parameter has such a value.

use core::fmt;

/// Why a value cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EncodingError {
    /// The bits are neither an integer nor a whole number.
    NotInteger,
    /// `REAL32` with the bits of an integer.
    IntegerBits,
    /// A type of 64 bits, or none that MAVLink defines. Holds the `MAV_PARAM_TYPE`.
    Kind(u8),
}

impl fmt::Display for EncodingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EncodingError::NotInteger => f.write_str("typed integer, but is none"),
            EncodingError::IntegerBits => f.write_str("integer bits in a REAL32"),
            EncodingError::Kind(kind) => write!(f, "type {kind} unsupported, use REAL32"),
        }
    }
}

/// `MAV_PARAM_TYPE_REAL32`.
const REAL32: u8 = 9;

/// The number that was meant by `sent` with this `MAV_PARAM_TYPE`. NaN and infinity of a `REAL32` pass: the range check
/// refuses them.
pub(crate) fn decode(kind: u8, sent: f32) -> Result<f32, EncodingError> {
    let integer = |bits: u32| match kind {
        1 => bits as u8 as f32,
        2 => bits as u8 as i8 as f32,
        3 => bits as u16 as f32,
        4 => bits as u16 as i16 as f32,
        5 => bits as f32,
        _ => bits as i32 as f32,
    };
    match kind {
        1..=6 => {
            let bits = sent.to_bits();
            let is_small = bits < 1 << 23 || bits as i32 >= -(1 << 23) && (bits as i32) < 0;
            if is_small {
                Ok(integer(bits))
            } else if sent as i32 as f32 == sent {
                Ok(sent)
            } else {
                Err(EncodingError::NotInteger)
            }
        }
        REAL32 if sent.is_subnormal() => Err(EncodingError::IntegerBits),
        REAL32 => Ok(sent),
        _ => Err(EncodingError::Kind(kind)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INT32: u8 = 6;

    #[test]
    fn integers_are_read_in_both_encodings() {
        for number in [-300_i32, -1, 0, 1, 2, 12, 120, 500] {
            let bytewise = f32::from_bits(number as u32);
            assert_eq!(decode(INT32, bytewise), Ok(number as f32), "bytes of {number}");
            assert_eq!(decode(INT32, number as f32), Ok(number as f32), "number {number}");
        }
        assert_eq!(decode(2, f32::from_bits(0xFF)), Ok(-1.0), "INT8");
        assert_eq!(decode(1, f32::from_bits(0xFF)), Ok(255.0), "UINT8");
        assert_eq!(decode(INT32, 0.5), Err(EncodingError::NotInteger));
    }

    #[test]
    fn a_real32_is_taken_as_sent() {
        for number in [0.0, -0.0, 0.7, 1e-30, f32::INFINITY] {
            assert_eq!(decode(REAL32, number), Ok(number));
        }
        assert!(decode(REAL32, f32::NAN).is_ok_and(f32::is_nan));
        assert_eq!(decode(REAL32, f32::from_bits(12)), Err(EncodingError::IntegerBits));
        for kind in [0, 7, 8, 10, 255] {
            assert_eq!(decode(kind, 1.0), Err(EncodingError::Kind(kind)));
        }
    }
}
