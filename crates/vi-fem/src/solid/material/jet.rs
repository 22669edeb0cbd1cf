//! Values with derivatives by three variables, in SIMD lanes.
//!
//! A [`Jet`] is a value with G first and H second derivatives: `Jet<R, 0, 0>` is a value alone, `Jet<R, 3, 0>` has the
//! gradient, `Jet<R, 3, 6>` also the packed lower triangle of the second derivatives.

use crate::lanes::real::Real;

/// A value with derivatives by three variables.
#[derive(Clone, Copy)]
pub(crate) struct Jet<R, const G: usize, const H: usize> {
    pub(crate) value: R,
    /// ∂/∂(variable k).
    pub(crate) first: [R; G],
    /// ∂²/∂(variable i)∂(variable j), packed as (0,0) (1,0) (1,1) (2,0) (2,1) (2,2).
    pub(crate) second: [R; H],
}

/// Rows and columns of the packed second derivatives.
pub(super) const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

impl<R: Real, const G: usize, const H: usize> Jet<R, G, H> {
    /// Returns a constant.
    #[inline(always)]
    pub(super) fn constant(value: R) -> Self {
        let zero = value.constant(0.0);
        Self { value, first: [zero; G], second: [zero; H] }
    }

    /// Returns variable number k.
    #[inline(always)]
    pub(super) fn variable(value: R, k: usize) -> Self {
        let mut jet = Self::constant(value);
        if k < G {
            jet.first[k] = value.constant(1.0);
        }
        jet
    }

    #[inline(always)]
    pub(super) fn shifted(mut self, by: f64) -> Self {
        self.value = self.value + by;
        self
    }

    #[inline(always)]
    pub(super) fn scaled(mut self, by: f64) -> Self {
        self.value = self.value * by;
        for k in 0..G {
            self.first[k] = self.first[k] * by;
        }
        for k in 0..H {
            self.second[k] = self.second[k] * by;
        }
        self
    }

    #[inline(always)]
    pub(super) fn plus(mut self, other: Self, sign: f64) -> Self {
        let sign = self.value.constant(sign);
        self.value = other.value.mul_add(sign, self.value);
        for k in 0..G {
            self.first[k] = other.first[k].mul_add(sign, self.first[k]);
        }
        for k in 0..H {
            self.second[k] = other.second[k].mul_add(sign, self.second[k]);
        }
        self
    }

    #[inline(always)]
    pub(super) fn times(self, other: Self) -> Self {
        let mut out = self;
        out.value = self.value * other.value;
        for k in 0..G {
            out.first[k] = self.first[k].mul_add(other.value, self.value * other.first[k]);
        }
        for k in 0..H {
            let (i, j) = PAIRS[k];
            let mixed = self.first[i].mul_add(other.first[j], self.first[j] * other.first[i]);
            let outer = self.second[k].mul_add(other.value, self.value * other.second[k]);
            out.second[k] = mixed + outer;
        }
        out
    }

    /// Returns f of this value, from f, f′ and f″ there.
    #[inline(always)]
    pub(super) fn chained(self, [value, by, by_by]: [R; 3]) -> Self {
        let mut out = self;
        out.value = value;
        for k in 0..G {
            out.first[k] = by * self.first[k];
        }
        for k in 0..H {
            let (i, j) = PAIRS[k];
            out.second[k] = by_by.mul_add(self.first[i] * self.first[j], by * self.second[k]);
        }
        out
    }

    /// Returns the larger value with its derivatives.
    #[inline(always)]
    pub(super) fn larger(self, other: Self) -> Self {
        let ahead = self.value - other.value;
        let mut out = self;
        out.value = ahead.if_positive(self.value, other.value);
        for k in 0..G {
            out.first[k] = ahead.if_positive(self.first[k], other.first[k]);
        }
        for k in 0..H {
            out.second[k] = ahead.if_positive(self.second[k], other.second[k]);
        }
        out
    }
}
