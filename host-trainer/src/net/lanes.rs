//! Vectors of sixteen numbers, and the selection of the instruction set at run time.
//!
//! The build targets the baseline processor of its architecture. [`vectorised!`] therefore compiles the inner loops for
//! several instruction sets, and calls the widest that the processor supports. The loops use [`Lanes`], so the order of the
//! sums and every bit of the result are the same with AVX2 and AVX-512. The portable version rounds differently, because it
//! has no fused multiply-add.

/// Numbers in [`Lanes`].
pub(super) const LANES: usize = 16;

/// Whether the portable version has a fast fused multiply-add.
pub(super) const PORTABLE_FUSED: bool = cfg!(target_arch = "aarch64");

/// Compiles `$body` for each instruction set, and defines `$name` to call the widest.
macro_rules! vectorised {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) = $body:ident) => {
        $(#[$doc])*
        $vis fn $name($($arg: $ty),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma")]
                fn avx512($($arg: $ty),*) {
                    $body::<true>($($arg),*);
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $ty),*) {
                    $body::<true>($($arg),*);
                }
                if $crate::net::lanes::has_avx512() {
                    // SAFETY: the processor has every feature that the function enables.
                    return unsafe { avx512($($arg),*) };
                }
                if $crate::net::lanes::has_avx2() {
                    // SAFETY: as above.
                    return unsafe { avx2($($arg),*) };
                }
            }
            $body::<{ $crate::net::lanes::PORTABLE_FUSED }>($($arg),*);
        }
    };
}
pub(super) use vectorised;

#[cfg(target_arch = "x86_64")]
pub(super) fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
        && has_avx2()
}

#[cfg(target_arch = "x86_64")]
pub(super) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// `a * b + c`, rounded once where `FUSED`.
#[inline(always)]
pub(super) fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Sixteen numbers. The compiler turns loops over them into vector instructions.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Lanes(pub [f32; LANES]);

impl Lanes {
    pub const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// The first sixteen numbers of a slice.
    #[inline(always)]
    pub fn load(slice: &[f32]) -> Self {
        let mut lanes = Self::ZERO;
        lanes.0.copy_from_slice(&slice[..LANES]);
        lanes
    }

    #[inline(always)]
    pub fn store(self, slice: &mut [f32]) {
        slice[..LANES].copy_from_slice(&self.0);
    }

    #[inline(always)]
    pub fn add(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] += other.0[i];
        }
        self
    }

    #[inline(always)]
    pub fn sub(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] -= other.0[i];
        }
        self
    }

    #[inline(always)]
    pub fn mul(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] *= other.0[i];
        }
        self
    }

    /// The larger of each number and 0.
    #[inline(always)]
    pub fn rectified(mut self) -> Self {
        for i in 0..LANES {
            self.0[i] = if self.0[i] > 0.0 { self.0[i] } else { 0.0 };
        }
        self
    }

    /// `self * a + b`.
    #[inline(always)]
    pub fn mul_add<const FUSED: bool>(mut self, a: Self, b: Self) -> Self {
        for i in 0..LANES {
            self.0[i] = multiply_add::<FUSED>(self.0[i], a.0[i], b.0[i]);
        }
        self
    }

    /// The sum, by adding halves.
    #[inline(always)]
    pub fn sum(self) -> f32 {
        let mut v = self.0;
        let mut half = LANES / 2;
        while half > 0 {
            for i in 0..half {
                v[i] += v[i + half];
            }
            half /= 2;
        }
        v[0]
    }

    #[inline(always)]
    pub fn largest(self) -> f32 {
        let mut v = self.0;
        let mut half = LANES / 2;
        while half > 0 {
            for i in 0..half {
                v[i] = if v[i] > v[i + half] { v[i] } else { v[i + half] };
            }
            half /= 2;
        }
        v[0]
    }

    /// `e^x` for `x` at most 0, to about one unit in the last place; 0 below -87.
    ///
    /// `x = n ln 2 + r` with `|r| <= ln 2 / 2`, then a polynomial in `r` (Cephes `expf`).
    #[inline(always)]
    pub fn exp<const FUSED: bool>(self) -> Self {
        const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23: adding it leaves the nearest whole number
        let mut result = Self::ZERO;
        for i in 0..LANES {
            let x = self.0[i];
            let clamped = if x > -87.0 { x } else { -87.0 };
            let shifted = multiply_add::<FUSED>(clamped, std::f32::consts::LOG2_E, ROUND);
            let n = shifted - ROUND;
            let r = multiply_add::<FUSED>(n, -0.693_359_4, clamped);
            let r = multiply_add::<FUSED>(n, 2.121_944_4e-4, r);
            let mut p = 1.987_569_1e-4;
            for c in [1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 0.166_666_65, 0.5] {
                p = multiply_add::<FUSED>(p, r, c);
            }
            let p = multiply_add::<FUSED>(p, r * r, r) + 1.0;
            let power = shifted.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127) << 23;
            let value = p * f32::from_bits(power);
            result.0[i] = if x > -87.0 { value } else { 0.0 };
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_agrees_with_the_standard_library() {
        for step in 0..20_000 {
            let x = -0.004_3 * step as f32;
            let exact = f64::from(x).exp();
            for value in [Lanes::splat(x).exp::<true>().0[3], Lanes::splat(x).exp::<false>().0[3]] {
                let error = (f64::from(value) - exact).abs() / exact;
                assert!(error < 3e-7, "exp({x}) = {value}, not {exact}");
            }
        }
        assert_eq!(Lanes::splat(f32::NEG_INFINITY).exp::<false>().0, [0.0; LANES]);
        assert_eq!(Lanes::splat(0.0).exp::<true>().0, [1.0; LANES]);
    }
}
