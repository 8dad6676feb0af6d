//! The exponential of softmax on vector registers.

use pulp::Simd;

/// `e^x` for x <= 0: the bits of [`libm::expf`], which the portable engine uses.
///
/// The algorithm is that of FreeBSD's `e_expf.c`, with selections in place of its branches. NaN stays NaN.
#[inline(always)]
pub(super) fn exp<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    const HALF_LN_2: f32 = f32::from_bits(0x3eb1_7218);
    const LN_2_AND_A_HALF: f32 = f32::from_bits(0x3f85_1592);
    const TINY: f32 = f32::from_bits(0x3900_0000);
    /// From here on the result is 0.
    const UNDERFLOW: f32 = f32::from_bits(0x42cf_f1b5);
    const INVERSE_LN_2: f32 = f32::from_bits(0x3fb8_aa3b);
    const LN_2_HIGH: f32 = f32::from_bits(0x3f31_7200);
    const LN_2_LOW: f32 = f32::from_bits(0x35bf_be8e);
    const P1: f32 = f32::from_bits(0x3e2a_aa8f);
    const P2: f32 = f32::from_bits(0xbb35_5215);
    /// 2^23: a sum with it has no fraction, and its low bits are the number.
    const WHOLE: f32 = 8_388_608.0;
    let splat = |number: f32| simd.splat_f32s(number);
    let below = |a, b| simd.less_than_f32s(a, b);
    let magnitude = simd.sub_f32s(splat(0.0), x);
    // n: how often ln 2 is in |x|, rounded.
    let quotient = simd.add_f32s(simd.mul_f32s(splat(INVERSE_LN_2), magnitude), splat(0.5));
    let rounded = simd.sub_f32s(simd.add_f32s(quotient, splat(WHOLE)), splat(WHOLE));
    let truncated = simd.sub_f32s(rounded, splat(1.0));
    let n = simd.select_f32s(below(quotient, rounded), truncated, rounded);
    let n = simd.select_f32s(below(splat(LN_2_AND_A_HALF), magnitude), n, splat(1.0));
    let n = simd.select_f32s(below(splat(HALF_LN_2), magnitude), n, splat(0.0));
    let high = simd.add_f32s(x, simd.mul_f32s(n, splat(LN_2_HIGH)));
    let low = simd.mul_f32s(n, splat(-LN_2_LOW));
    let r = simd.sub_f32s(high, low);
    let rr = simd.mul_f32s(r, r);
    let polynomial = simd.add_f32s(splat(P1), simd.mul_f32s(rr, splat(P2)));
    let c = simd.sub_f32s(r, simd.mul_f32s(rr, polynomial));
    let fraction = simd.div_f32s(simd.mul_f32s(r, c), simd.sub_f32s(splat(2.0), c));
    let sum = simd.add_f32s(simd.sub_f32s(fraction, low), high);
    let y = simd.add_f32s(splat(1.0), sum);
    // 2^-n in two factors, because the result may be subnormal.
    let one = simd.splat_u32s(1.0_f32.to_bits());
    let whole = simd.transmute_u32s_f32s(simd.add_f32s(n, splat(WHOLE)));
    let whole = simd.sub_u32s(whole, simd.splat_u32s(WHOLE.to_bits()));
    let half = simd.wrapping_dyn_shr_u32s(whole, simd.splat_u32s(1));
    let power = |n| {
        let exponent = simd.wrapping_dyn_shl_u32s(n, simd.splat_u32s(23));
        simd.transmute_f32s_u32s(simd.sub_u32s(one, exponent))
    };
    let y = simd.mul_f32s(simd.mul_f32s(y, power(half)), power(simd.sub_u32s(whole, half)));
    let y = simd.select_f32s(below(splat(TINY), magnitude), y, simd.add_f32s(splat(1.0), x));
    simd.select_f32s(below(splat(UNDERFLOW.next_down()), magnitude), splat(0.0), y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    struct All<'a>(&'a mut [f32]);

    impl WithSimd for All<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            for x in S::as_mut_simd_f32s(self.0).0 {
                *x = exp(simd, *x);
            }
        }
    }

    #[test]
    fn every_bit_is_that_of_libm() {
        // Every 577th number from -0 to -150, and the neighbours of each branch.
        let mut inputs: Vec<u32> = (0x8000_0000..(-150.0_f32).to_bits()).step_by(577).collect();
        for limit in [0x3eb1_7218_u32, 0x3f85_1592, 0x3900_0000, 0x42ae_ac50, 0x42cf_f1b5] {
            inputs.extend((limit - 300..limit + 300).map(|bits| bits | 0x8000_0000));
        }
        inputs.resize(inputs.len().next_multiple_of(64), 0);
        let inputs: Vec<f32> = inputs.into_iter().map(f32::from_bits).collect();
        let mut found = inputs.clone();
        Arch::new().dispatch(All(&mut found));
        for (x, found) in inputs.into_iter().zip(found) {
            assert_eq!(found.to_bits(), libm::expf(x).to_bits(), "e^{x}: {found}");
        }
        let mut nan = [f32::NAN; 64];
        Arch::new().dispatch(All(&mut nan));
        assert!(nan.iter().all(|number| number.is_nan()));
    }
}
