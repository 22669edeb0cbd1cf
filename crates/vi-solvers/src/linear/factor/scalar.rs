//! The number types of a factor, f64 or f32, and the vector operations on them that a substitution needs.

use std::ops::{Add, AddAssign, Div, Mul, Sub, SubAssign};

use pulp::Simd;

/// The number type of a factor: f64, or f32 for half the work if something else corrects its errors.
pub trait Scalar:
    faer::traits::RealField
    + Columns
    + Copy
    + Default
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + SubAssign
{
    /// Whether the type is f32.
    const IS_SINGLE: bool;
    /// The size below which entries of matrices with diagonal entries of about one, and of their factors, count as zero: much
    /// less than their round-off, and so much that products are normal numbers.
    const NEGLIGIBLE: Self;
    /// Number of columns that a tiled front eliminates at a time.
    ///
    /// In single precision all fronts with more columns are tiled, so that few entries are computed from negligible ones: before matrices
    /// were balanced, a factor of the flag of 5043 equations took 18 ms without tiles and 11 ms with 32 columns.
    const PANEL: usize;
    /// Returns the number nearest to `value`.
    fn of(value: f64) -> Self;
    /// Returns the number as f64.
    fn value(self) -> f64;
}

impl Scalar for f64 {
    const IS_SINGLE: bool = false;
    const NEGLIGIBLE: Self = 0.0;
    const PANEL: usize = 128;
    fn of(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
}

impl Scalar for f32 {
    const IS_SINGLE: bool = true;
    // 2⁻⁴⁰: round-off is 2⁻²⁴, and the least normal number 2⁻¹²⁶.
    const NEGLIGIBLE: Self = 1.0 / (1_u64 << 40) as Self;
    const PANEL: usize = 32;
    fn of(value: f64) -> Self {
        value as f32
    }
    fn value(self) -> f64 {
        f64::from(self)
    }
}

/// Sets numbers in single precision that are smaller than `size` to zero.
pub(super) fn drop_below<T: Scalar>(size: T, numbers: &mut [T]) {
    if T::IS_SINGLE {
        let (zero, minus) = (T::default(), T::default() - size);
        for number in numbers {
            *number = if *number < size && *number > minus { zero } else { *number };
        }
    }
}

/// Number of columns handled at a time: each number of the vector is read and written once for four columns.
pub(super) const COLUMNS: usize = 4;

/// Operations of four columns on a vector, with the vector instructions of the machine.
pub trait Columns: Sized {
    /// Computes target ← target − Σ_j x_j column_j; all have the same length.
    fn subtract<S: Simd>(simd: S, target: &mut [Self], columns: [&[Self]; COLUMNS], x: [Self; COLUMNS]);
    /// Returns Σ_i column_ji x_i for every column j; all have the same length.
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
