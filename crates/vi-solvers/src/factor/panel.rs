//! Substitution through one panel, in whatever vectors the machine has. It must not know the tree.

use pulp::{Simd, WithSimd};

use super::front::Scalar;

/// Columns handled at a time: each number of the vector is read and written once for four of the panel.
const COLUMNS: usize = 4;

/// What four columns do to a vector, in vectors of the machine.
pub trait Columns: Sized {
    /// target ← target − Σ_j x_j column_j, all of one length.
    fn subtract<S: Simd>(simd: S, target: &mut [Self], columns: [&[Self]; COLUMNS], x: [Self; COLUMNS]);
    /// Σ_i column_ji x_i of every column, all of one length.
    fn products<S: Simd>(simd: S, columns: [&[Self]; COLUMNS], x: &[Self]) -> [Self; COLUMNS];
}

macro_rules! columns {
    ($number:ty, $split:ident, $split_mut:ident, $splat:ident, $fma:ident, $sum:ident, $load:ident, $store:ident) => {
        impl Columns for $number {
            #[inline(always)]
            fn subtract<S: Simd>(
                simd: S,
                target: &mut [Self],
                columns: [&[Self]; COLUMNS],
                x: [Self; COLUMNS],
            ) {
                let minus = [simd.$splat(-x[0]), simd.$splat(-x[1]), simd.$splat(-x[2]), simd.$splat(-x[3])];
                let (target, rest) = S::$split_mut(target);
                let (a, a_rest) = S::$split(columns[0]);
                let (b, b_rest) = S::$split(columns[1]);
                let (c, c_rest) = S::$split(columns[2]);
                let (d, d_rest) = S::$split(columns[3]);
                let length = target.len();
                let (a, b, c, d) = (&a[..length], &b[..length], &c[..length], &d[..length]);
                for i in 0..length {
                    let value = simd.$fma(minus[0], a[i], target[i]);
                    let value = simd.$fma(minus[1], b[i], value);
                    let value = simd.$fma(minus[2], c[i], value);
                    target[i] = simd.$fma(minus[3], d[i], value);
                }
                if !rest.is_empty() {
                    let value = simd.$fma(minus[0], simd.$load(a_rest), simd.$load(rest));
                    let value = simd.$fma(minus[1], simd.$load(b_rest), value);
                    let value = simd.$fma(minus[2], simd.$load(c_rest), value);
                    simd.$store(rest, simd.$fma(minus[3], simd.$load(d_rest), value));
                }
            }

            #[inline(always)]
            fn products<S: Simd>(simd: S, columns: [&[Self]; COLUMNS], x: &[Self]) -> [Self; COLUMNS] {
                let (x, rest) = S::$split(x);
                let (a, a_rest) = S::$split(columns[0]);
                let (b, b_rest) = S::$split(columns[1]);
                let (c, c_rest) = S::$split(columns[2]);
                let (d, d_rest) = S::$split(columns[3]);
                let length = x.len();
                let (a, b, c, d) = (&a[..length], &b[..length], &c[..length], &d[..length]);
                let zero = simd.$splat(0.0);
                let mut sums = [zero; COLUMNS];
                for i in 0..length {
                    sums[0] = simd.$fma(a[i], x[i], sums[0]);
                    sums[1] = simd.$fma(b[i], x[i], sums[1]);
                    sums[2] = simd.$fma(c[i], x[i], sums[2]);
                    sums[3] = simd.$fma(d[i], x[i], sums[3]);
                }
                if !rest.is_empty() {
                    let x = simd.$load(rest);
                    sums[0] = simd.$fma(simd.$load(a_rest), x, sums[0]);
                    sums[1] = simd.$fma(simd.$load(b_rest), x, sums[1]);
                    sums[2] = simd.$fma(simd.$load(c_rest), x, sums[2]);
                    sums[3] = simd.$fma(simd.$load(d_rest), x, sums[3]);
                }
                [simd.$sum(sums[0]), simd.$sum(sums[1]), simd.$sum(sums[2]), simd.$sum(sums[3])]
            }
        }
    };
}

columns!(
    f64,
    as_simd_f64s,
    as_mut_simd_f64s,
    splat_f64s,
    mul_add_f64s,
    reduce_sum_f64s,
    partial_load_f64s,
    partial_store_f64s
);
columns!(
    f32,
    as_simd_f32s,
    as_mut_simd_f32s,
    splat_f32s,
    mul_add_f32s,
    reduce_sum_f32s,
    partial_load_f32s,
    partial_store_f32s
);

/// own ← L₁₁⁻¹ own, below ← below − L₂₁ own, of a panel of columns of `rows` numbers.
pub(super) struct Eliminate<'a, T> {
    pub(super) panel: &'a [T],
    pub(super) rows: usize,
    pub(super) own: &'a mut [T],
    pub(super) below: &'a mut [T],
}

impl<T: Scalar> WithSimd for Eliminate<'_, T> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { panel, rows, own, below } = self;
        let mut first = 0;
        while first < own.len() {
            let width = COLUMNS.min(own.len() - first);
            let mut x = [T::default(); COLUMNS];
            for j in 0..width {
                let column = &panel[(first + j) * rows..][..rows];
                x[j] = own[first + j] / column[first + j];
                own[first + j] = x[j];
                for i in j + 1..width {
                    own[first + i] -= column[first + i] * x[j];
                }
            }
            let (next, split) = (first + width, own.len());
            if width == COLUMNS {
                let a = &panel[first * rows..][..rows];
                let b = &panel[(first + 1) * rows..][..rows];
                let c = &panel[(first + 2) * rows..][..rows];
                let d = &panel[(first + 3) * rows..][..rows];
                let inner = [&a[next..split], &b[next..split], &c[next..split], &d[next..split]];
                T::subtract(simd, &mut own[next..], inner, x);
                T::subtract(simd, below, [&a[split..], &b[split..], &c[split..], &d[split..]], x);
            } else {
                // The last columns: no others are between them and the rows below.
                for j in 0..width {
                    let column = &panel[(first + j) * rows..][split..rows];
                    for i in 0..column.len() {
                        below[i] -= column[i] * x[j];
                    }
                }
            }
            first = next;
        }
    }
}

/// own ← L₁₁⁻ᵀ (own − L₂₁ᵀ below), of a panel of columns of `rows` numbers.
pub(super) struct Substitute<'a, T> {
    pub(super) panel: &'a [T],
    pub(super) rows: usize,
    pub(super) own: &'a mut [T],
    pub(super) below: &'a [T],
}

impl<T: Scalar> WithSimd for Substitute<'_, T> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { panel, rows, own, below } = self;
        let split = own.len();
        let mut end = split;
        while end > 0 {
            let width = if end.is_multiple_of(COLUMNS) { COLUMNS } else { end % COLUMNS };
            let first = end - width;
            let last = width - 1;
            let a = &panel[first * rows..][..rows];
            let b = &panel[(first + last.min(1)) * rows..][..rows];
            let c = &panel[(first + last.min(2)) * rows..][..rows];
            let d = &panel[(first + last) * rows..][..rows];
            let inner = [&a[end..split], &b[end..split], &c[end..split], &d[end..split]];
            let within = T::products(simd, inner, &own[end..]);
            let sums = T::products(simd, [&a[split..], &b[split..], &c[split..], &d[split..]], below);
            for j in (0..width).rev() {
                let column = &panel[(first + j) * rows..][..rows];
                let mut value = own[first + j] - (within[j] + sums[j]);
                for i in j + 1..width {
                    value -= column[first + i] * own[first + i];
                }
                own[first + j] = value / column[first + j];
            }
            end = first;
        }
    }
}
