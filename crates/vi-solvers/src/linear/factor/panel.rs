//! Substitutes through one panel, with the vector instructions of the machine.

use pulp::{Simd, WithSimd};

use super::scalar::{COLUMNS, Scalar};

/// Computes own ← L₁₁⁻¹ own and below ← below − L₂₁ own for a panel whose columns have `rows` numbers.
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
                // The last columns: no further columns lie between them and the rows below.
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

/// Computes own ← L₁₁⁻ᵀ (own − L₂₁ᵀ below) for a panel whose columns have `rows` numbers.
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
