//! The scalar type of laws and elements: one number (f64), or one group of SIMD lanes.
//!
//! A kernel that is written once over [`Real`] runs on any vector unit. A lane group carries pulp's token, which
//! proves that the instructions exist; hence this file needs no `unsafe`. A lane group can only be made from another
//! one, and so constants come from [`Real::constant`].

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

/// A real number, or several numbers that go through the same arithmetic side by side.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// Returns `value` in every lane. `self` only gives the type of the lanes; its value is not used.
    fn constant(self, value: f64) -> Self;
    /// Returns self · b + c, fused if the machine can.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Returns √self.
    fn sqrt(self) -> Self;
    /// Returns |self|.
    fn abs(self) -> Self;
    /// Returns ln self with an error of about one unit in the last place; NaN for self ≤ 0, not finite for ∞.
    fn ln(self) -> Self;
    /// Returns ∛self.
    fn cbrt(self) -> Self;
    /// Applies a scalar function to each lane, one by one.
    fn map(self, function: impl Fn(f64) -> f64) -> Self;
    /// Selects per lane: `then` if self > 0, else `otherwise` (also for NaN).
    fn if_positive(self, then: Self, otherwise: Self) -> Self;
    /// Returns whether self > 0 in every lane.
    fn is_positive(self) -> bool;
}

impl Real for f64 {
    #[inline(always)]
    fn constant(self, value: f64) -> f64 {
        value
    }
    #[inline(always)]
    fn mul_add(self, b: f64, c: f64) -> f64 {
        self * b + c
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        self.sqrt()
    }
    #[inline(always)]
    fn abs(self) -> f64 {
        self.abs()
    }
    #[inline(always)]
    fn ln(self) -> f64 {
        if self > 0.0 { self.ln() } else { f64::NAN }
    }
    #[inline(always)]
    fn cbrt(self) -> f64 {
        self.cbrt()
    }
    #[inline(always)]
    fn map(self, function: impl Fn(f64) -> f64) -> f64 {
        function(self)
    }
    #[inline(always)]
    fn if_positive(self, then: f64, otherwise: f64) -> f64 {
        if self > 0.0 { then } else { otherwise }
    }
    #[inline(always)]
    fn is_positive(self) -> bool {
        self > 0.0
    }
}

/// A group of f64 lanes of the instruction set `S`.
#[derive(Clone, Copy)]
pub(crate) struct Lane<S: Simd> {
    simd: S,
    v: S::f64s,
}

impl<S: Simd> Lane<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, v: S::f64s) -> Self {
        Self { simd, v }
    }

    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        Self { simd, v: simd.splat_f64s(value) }
    }

    /// Returns the lanes as the machine's register type.
    #[inline(always)]
    pub(crate) fn raw(self) -> S::f64s {
        self.v
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $instruction:ident) => {
        impl<S: Simd> $trait for Lane<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$instruction(self.v, other.v) }
            }
        }
        impl<S: Simd> $trait<f64> for Lane<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                Self { simd: self.simd, v: self.simd.$instruction(self.v, self.simd.splat_f64s(other)) }
            }
        }
    };
}
operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Simd> Neg for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { simd: self.simd, v: self.simd.neg_f64s(self.v) }
    }
}

impl<S: Simd> Real for Lane<S> {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self::splat(self.simd, value)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self { simd: self.simd, v: self.simd.mul_add_e_f64s(self.v, b.v, c.v) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self { simd: self.simd, v: self.simd.sqrt_f64s(self.v) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self { simd: self.simd, v: self.simd.abs_f64s(self.v) }
    }
    #[inline(always)]
    fn ln(self) -> Self {
        if S::F64_LANES == 1 { self.map(Real::ln) } else { self.ln_in_lanes() }
    }
    #[inline(always)]
    fn cbrt(self) -> Self {
        self.map(f64::cbrt)
    }
    #[inline(always)]
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        let mut lanes = [self.v];
        for value in pulp::bytemuck::cast_slice_mut::<_, f64>(&mut lanes) {
            *value = function(*value);
        }
        Self { simd: self.simd, v: lanes[0] }
    }
    #[inline(always)]
    fn if_positive(self, then: Self, otherwise: Self) -> Self {
        let positive = self.simd.greater_than_f64s(self.v, self.simd.splat_f64s(0.0));
        Self { simd: self.simd, v: self.simd.select_f64s(positive, then.v, otherwise.v) }
    }
    #[inline(always)]
    fn is_positive(self) -> bool {
        let one = self.constant(1.0);
        self.simd.reduce_min_f64s(self.if_positive(one, -one).v) > 0.0
    }
}

impl<S: Simd> Lane<S> {
    /// Computes ln x = k ln 2 + ln m with m in [√½, √2) and ln m = f − f²/2 + s(f²/2 + R(s²)), where f = m − 1 and s
    /// = f/(2 + f). R has the minimax coefficients of FDLIBM's e_log.c (error below one unit in the last place).
    /// Subnormal numbers (below 2⁻¹⁰²²) are treated as slightly above 2⁻¹⁰²².
    #[allow(clippy::excessive_precision, reason = "the published digits")]
    #[inline(always)]
    fn ln_in_lanes(self) -> Self {
        let simd = self.simd;
        let bits = simd.transmute_u64s_f64s(self.v);
        // Extract the exponent: shift it to the bottom of the high half, then read it as the mantissa of a number in
        // [2⁸⁴, 2⁸⁵). The last place of the high half is worth 2³² there, so it counts in units of 2⁶⁴.
        let high: S::u32s = pulp::bytemuck::cast(simd.and_u64s(bits, simd.splat_u64s(0x7ff0_0000_0000_0000)));
        let shifted = simd.wrapping_dyn_shr_u32s(high, simd.splat_u32s(20));
        let two_84 = f64::from_bits((1023 + 84) << 52);
        let counted = simd.or_u64s(pulp::bytemuck::cast(shifted), simd.splat_u64s(two_84.to_bits()));
        let k = (Self { simd, v: simd.transmute_f64s_u64s(counted) } - two_84)
            * f64::from_bits((1023 - 64) << 52)
            - 1023.0;
        let mantissa = simd.or_u64s(
            simd.and_u64s(bits, simd.splat_u64s(0x000f_ffff_ffff_ffff)),
            simd.splat_u64s(1.0f64.to_bits()),
        );
        let m = Self { simd, v: simd.transmute_f64s_u64s(mantissa) };
        let above = m - std::f64::consts::SQRT_2;
        let m = above.if_positive(m * 0.5, m);
        let k = above.if_positive(k + 1.0, k);

        let f = m - 1.0;
        let s = f / (f + 2.0);
        let z = s * s;
        let mut r = self.constant(1.479_819_860_511_658_591e-1);
        for coefficient in [
            1.531_383_769_920_937_332e-1,
            1.818_357_216_161_805_012e-1,
            2.222_219_843_214_978_396e-1,
            2.857_142_874_366_239_149e-1,
            3.999_999_999_940_941_908e-1,
            6.666_666_666_666_735_130e-1,
        ] {
            r = r.mul_add(z, self.constant(coefficient));
        }
        let half_square = f * f * 0.5;
        let correction = s * r.mul_add(z, half_square) + k * 1.908_214_929_270_587_700_02e-10;
        let value = k * 6.931_471_803_691_238_164_90e-1 - ((half_square - correction) - f);
        // Propagate ∞ as NaN: 0 · x is zero for finite x and NaN for ∞.
        self.if_positive(value + self * 0.0, self.constant(f64::NAN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct LnOf<'a>(&'a mut [f64; 8]);
    impl pulp::WithSimd for LnOf<'_> {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            let (groups, _) = S::as_mut_simd_f64s(&mut self.0[..]);
            for group in groups {
                *group = Lane::new(simd, *group).ln().raw();
            }
        }
    }

    #[test]
    fn the_logarithm_of_a_lane_is_exact_to_its_last_places() {
        let mut samples: Vec<f64> = (1..4000).map(|i| i as f64 * 7.31e-4).collect();
        samples.extend((-300..300).map(|e| 1.37 * 10f64.powi(e)));
        samples.extend((1..60).flat_map(|e| [1.0 + 0.5f64.powi(e), 1.0 - 0.5f64.powi(e)]));
        samples.resize(samples.len().next_multiple_of(8), 1.0);
        for chunk in samples.chunks_exact(8) {
            let mut values: [f64; 8] = chunk.try_into().unwrap();
            pulp::Arch::new().dispatch(LnOf(&mut values));
            for (x, value) in chunk.iter().zip(values) {
                let ulps = (value - x.ln()).abs() / (x.ln().abs() * f64::EPSILON + f64::MIN_POSITIVE);
                assert!(ulps <= 1.5, "ln {x} = {value}, {ulps} units off");
            }
        }
    }

    #[test]
    fn the_logarithm_of_a_lane_knows_its_domain() {
        let mut values = [0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0, -0.0, 2.0];
        pulp::Arch::new().dispatch(LnOf(&mut values));
        assert!([0, 1, 2, 4, 6].iter().all(|&i: &usize| values[i].is_nan()), "{values:?}");
        assert!(!values[3].is_finite() && values[5] == 0.0 && values[7] == 2f64.ln());
    }
}
