//! Sums and updates of vectors; long vectors are processed in parallel. The tree of every sum depends only on its
//! length, so the bits do not depend on the number of threads.
//!
//! Only the loop over a leaf is compiled for each caller. The recursion calls it through `dyn`, once per some
//! thousand entries. When the recursion was compiled for each caller too, the calls of `rayon::join` were half of
//! this crate's code.

use std::ops::Range;

use vi_core::binary_exponent;

/// Number of entries per task; it is also the leaf size of the tree of every sum.
const LEAF: usize = 4096;
/// Length above which parallel tasks pay off.
const PARALLEL: usize = 32_768;

/// Returns Σ term(k) over 0..n by a fixed binary tree.
pub(crate) fn sum(n: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let leaf = |leaf: Range<usize>| leaf.map(&term).sum();
    if n <= LEAF { leaf(0..n) } else { tree(0..n, &leaf, |a, b| a + b) }
}

/// Returns a·b.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    sum(a.len(), |k| a[k] * b[k])
}

/// Returns |a|.
pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Returns 1/u for a power of two u near `value`. Roots are taken of multiples of u, so that their bits do not depend
/// on the units of the scene.
pub(crate) fn per_unit(value: f64) -> f64 {
    2.0_f64.powi(-binary_exponent(value))
}

/// Returns whether all numbers are finite.
pub(crate) fn all_finite(values: &[f64]) -> bool {
    // 0 · x is zero for finite x, and NaN otherwise.
    sum(values.len(), |k| 0.0 * values[k]) == 0.0
}

/// Returns max |value(k)| over 0..n; NaN counts as +∞.
pub(crate) fn max_abs(n: usize, value: impl Fn(usize) -> f64 + Sync) -> f64 {
    let leaf = |leaf: Range<usize>| {
        leaf.fold(0.0_f64, |max, k| {
            let v = value(k).abs();
            if v.is_nan() { f64::INFINITY } else { max.max(v) }
        })
    };
    if n <= LEAF { leaf(0..n) } else { tree(0..n, &leaf, f64::max) }
}

fn tree(
    range: Range<usize>,
    leaf: &(dyn Fn(Range<usize>) -> f64 + Sync),
    combine: fn(f64, f64) -> f64,
) -> f64 {
    let n = range.len();
    if n <= LEAF {
        return leaf(range);
    }
    let middle = range.start + n / 2;
    let (left, right) = (range.start..middle, middle..range.end);
    let (a, b) = if n >= PARALLEL {
        rayon::join(|| tree(left, leaf, combine), || tree(right, leaf, combine))
    } else {
        (tree(left, leaf, combine), tree(right, leaf, combine))
    };
    combine(a, b)
}

/// Sets out[k] = value(k).
pub(crate) fn fill(out: &mut [f64], value: impl Fn(usize) -> f64 + Sync) {
    update(out, |k, out| *out = value(k));
}

/// Calls update(k, &mut a[k]) for every k.
pub(crate) fn update(a: &mut [f64], update: impl Fn(usize, &mut f64) + Sync) {
    let leaf = |first: usize, a: &mut [f64]| {
        for (k, a) in a.iter_mut().enumerate() {
            update(first + k, a);
        }
    };
    if a.len() < PARALLEL { leaf(0, a) } else { on_leaves(0, a, &leaf) }
}

fn on_leaves(first: usize, a: &mut [f64], leaf: &(dyn Fn(usize, &mut [f64]) + Sync)) {
    let n = a.len();
    if n < PARALLEL {
        return leaf(first, a);
    }
    let (left, right) = a.split_at_mut(n / 2);
    rayon::join(|| on_leaves(first, left, leaf), || on_leaves(first + n / 2, right, leaf));
}

/// Calls update(k, &mut a[k], &mut b[k]) for every k of two vectors of equal length.
pub(crate) fn update_pair(a: &mut [f64], b: &mut [f64], update: impl Fn(usize, &mut f64, &mut f64) + Sync) {
    let leaf = |first: usize, a: &mut [f64], b: &mut [f64]| {
        for (k, (a, b)) in a.iter_mut().zip(b).enumerate() {
            update(first + k, a, b);
        }
    };
    if a.len() < PARALLEL { leaf(0, a, b) } else { on_pairs_of_leaves(0, a, b, &leaf) }
}

type OnPair<'a> = dyn Fn(usize, &mut [f64], &mut [f64]) + Sync + 'a;

fn on_pairs_of_leaves(first: usize, a: &mut [f64], b: &mut [f64], leaf: &OnPair<'_>) {
    let n = a.len();
    if n < PARALLEL {
        return leaf(first, a, b);
    }
    let (a_left, a_right) = a.split_at_mut(n / 2);
    let (b_left, b_right) = b.split_at_mut(n / 2);
    rayon::join(
        || on_pairs_of_leaves(first, a_left, b_left, leaf),
        || on_pairs_of_leaves(first + n / 2, a_right, b_right, leaf),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_do_not_depend_on_the_number_of_threads() {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut a = vec![0.0; 200_001];
                fill(&mut a, |k| (k as f64).sin());
                let mut b = a.clone();
                update(&mut a, |k, a| *a /= 1.0 + k as f64);
                update_pair(&mut a, &mut b, |_, a, b| *b += *a);
                (sum(a.len(), |k| a[k] * b[k]), max_abs(b.len(), |k| b[k]))
            })
        };
        assert_eq!(run(1), run(2));
        assert_eq!(run(1), run(8));
    }

    #[test]
    fn nan_is_larger_than_any_number() {
        let a = [1.0, f64::NAN, 2.0];
        assert_eq!(max_abs(3, |k| a[k]), f64::INFINITY);
    }
}
