//! Lanczos' method for the highest frequency ω = √λ_max of an operator that is symmetric in an inner product, roughly and from above,
//! and for λ_max to round-off. It needs only products of the operator with vectors, and keeps two of its vectors.

use nalgebra::DMatrix;

use crate::error::SolverError;
use crate::vectors;

/// Largest number of Lanczos vectors.
const MAX_ITERATIONS: u32 = 120;
/// A vector of λ_max may be so small in the start vector that Ritz values settle near another eigenvalue first, with a small residual. For
/// a random start of n unknowns, the probability that λ_max is missed by the fraction ε after k iterations, in any spectrum, is at
/// most 1.65 √n exp(−√ε (2k − 1)) (J. Kuczyński, H. Woźniakowski, SIAM J. Matrix Anal. Appl. 13 (1992) 1094). No fewer iterations are made
/// than lead to this probability with this ε, by which steps of 0.8 of their limit may miss it.
const MISSED: f64 = 0.3;
const PROBABILITY: f64 = 1e-6;
/// Number of Lanczos vectors at the first look at λ_max to round-off, and the factor between looks.
const FIRST_LOOK: usize = 16;
const NEXT_LOOK: f64 = 1.25;
/// Relative change of λ_max between two looks below which it is known. The error falls geometrically with the number of vectors, so
/// it is then far below this.
const SETTLED: f64 = 1e-13;
/// Relative norm of the last vector below which the others span all that the start contains.
const CLOSED: f64 = 1e-13;
/// Largest number of vectors of such a search. The number grows with the largest number of nodes along a line.
const MOST_VECTORS: usize = 4000;

/// An estimate of the highest frequency about a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HighestFrequency {
    /// ω_max = √λ_max(M⁻¹K), rad/s, or √λ_max(W K) with a filtered mass: the Ritz value plus its residual bound. It is
    /// therefore an overestimate, by at most 1 % if the iteration converged.
    pub omega: f64,
    /// Number of products with K, each of two gradients.
    pub iterations: u32,
}

/// A linear operator A that is symmetric in an inner product.
pub(crate) trait SymmetricOperator {
    /// Computes `out` = A v for the vector v that was normalised last.
    fn apply(&mut self, v: &[f64], out: &mut [f64]) -> Result<(), SolverError>;
    /// Returns the inner product of `a` and the vector v that was normalised last.
    fn product(&self, a: &[f64], v: &[f64]) -> f64;
    /// Divides v by its norm, unless that is zero. Returns the norm.
    fn normalize(&mut self, v: &mut [f64]) -> f64;
}

/// Returns the highest frequency of an operator on n > 0 unknowns, whose relative error of λ_max is at most `accuracy` if the
/// iteration converges. The start vector is the same in every run.
///
/// # Errors
/// Returns the errors of the products.
pub(crate) fn highest(
    operator: &mut impl SymmetricOperator,
    n: usize,
    accuracy: f64,
) -> Result<HighestFrequency, SolverError> {
    let mut matrix = Tridiagonal::new(n);
    iterate(operator, n, |alpha, beta| matrix.enter(alpha, beta, accuracy))
}

/// Returns the largest eigenvalue of an operator on n > 0 unknowns to round-off: it does not depend on the start vector, and so not on
/// the numbering of the unknowns.
///
/// # Errors
/// Returns the errors of the products.
pub(crate) fn largest_eigenvalue(
    operator: &mut impl SymmetricOperator,
    n: usize,
) -> Result<f64, SolverError> {
    let (mut diagonal, mut off_diagonal) = (Vec::new(), Vec::new());
    let (mut look, mut size, mut last) = (FIRST_LOOK, 0.0_f64, f64::NEG_INFINITY);
    iterate(operator, n, |alpha, beta| {
        diagonal.push(alpha);
        size = size.max(alpha.abs() + beta);
        let (count, is_closed) = (diagonal.len(), beta.is_nan() || beta <= CLOSED * size);
        let mut found = None;
        if count >= look || is_closed || count == MOST_VECTORS {
            let value = largest_of_tridiagonal(&diagonal, &off_diagonal);
            let is_settled = value - last <= SETTLED * value.abs();
            found = (is_settled || is_closed || count == MOST_VECTORS).then_some(value);
            (look, last) = ((NEXT_LOOK * count as f64).ceil() as usize, value);
        }
        off_diagonal.push(beta);
        found
    })
}

/// Makes iterations from the same start vector in every run, until `enter` returns a result for the diagonal entry α of an iteration
/// and the norm β of its last vector.
fn iterate<R>(
    operator: &mut impl SymmetricOperator,
    n: usize,
    mut enter: impl FnMut(f64, f64) -> Option<R>,
) -> Result<R, SolverError> {
    let (mut previous, mut next) = (vec![0.0; n], vec![0.0; n]);
    let mut current: Vec<f64> = (0..n as u64).map(noise).collect();
    operator.normalize(&mut current);
    let mut beta = 0.0;
    loop {
        operator.apply(&current, &mut next)?;
        let alpha = operator.product(&next, &current);
        vectors::update(&mut next, |k, next| *next -= alpha * current[k] + beta * previous[k]);
        beta = operator.normalize(&mut next);
        if let Some(found) = enter(alpha, beta) {
            return Ok(found);
        }
        std::mem::swap(&mut previous, &mut current);
        std::mem::swap(&mut current, &mut next);
    }
}

/// Returns the largest eigenvalue of a symmetric tridiagonal matrix T by bisection: x is above all eigenvalues if all pivots of
/// x I − T are positive.
fn largest_of_tridiagonal(diagonal: &[f64], off_diagonal: &[f64]) -> f64 {
    let is_above = |x: f64| {
        let mut pivot = f64::INFINITY;
        diagonal.iter().enumerate().all(|(k, alpha)| {
            let beta = if k > 0 { off_diagonal[k - 1] } else { 0.0 };
            pivot = x - alpha - beta * beta / pivot;
            pivot > 0.0
        })
    };
    let radius = |k: usize| {
        let beta = |k: usize| off_diagonal.get(k).copied().unwrap_or(0.0);
        beta(k) + if k > 0 { beta(k - 1) } else { 0.0 }
    };
    let mut low = diagonal.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut high = (0..diagonal.len()).map(|k| diagonal[k] + radius(k)).fold(low, f64::max);
    loop {
        let middle = low + 0.5 * (high - low);
        if !(low < middle && middle < high) {
            return high;
        }
        (low, high) = if is_above(middle) { (low, middle) } else { (middle, high) };
    }
}

/// The tridiagonal matrix to which the operator on n unknowns is reduced.
pub(crate) struct Tridiagonal {
    n: usize,
    /// Smallest number of iterations.
    least: f64,
    diagonal: Vec<f64>,
    off_diagonal: Vec<f64>,
    /// The norm of the last vector; 0 at first.
    pub(crate) beta: f64,
}

impl Tridiagonal {
    pub(crate) fn new(n: usize) -> Self {
        let least = 0.5 * (1.0 + (1.65 * (n as f64).sqrt() / PROBABILITY).ln() / MISSED.sqrt());
        Self { n, least, diagonal: Vec::new(), off_diagonal: Vec::new(), beta: 0.0 }
    }

    /// Enters the diagonal entry α of an iteration and the norm β of its last vector. Returns the frequency if its relative error
    /// is at most `accuracy`, or if there are no more iterations.
    pub(crate) fn enter(&mut self, alpha: f64, beta: f64, accuracy: f64) -> Option<HighestFrequency> {
        self.diagonal.push(alpha);
        self.beta = beta;
        let is_closed = beta == 0.0 || self.diagonal.len() >= self.n;
        if !is_closed && (self.diagonal.len() as f64) < self.least {
            self.off_diagonal.push(beta);
            return None;
        }
        let (ritz, residual) = largest_ritz_value(&self.diagonal, &self.off_diagonal, beta);
        let iterations = self.diagonal.len() as u32;
        let is_enough = residual <= accuracy * ritz.abs() || is_closed || iterations == MAX_ITERATIONS;
        self.off_diagonal.push(beta);
        is_enough.then(|| HighestFrequency { omega: (ritz + residual).max(0.0).sqrt(), iterations })
    }
}

/// Returns the largest eigenvalue of the tridiagonal matrix, and the residual β |s_last| of its vector.
fn largest_ritz_value(diagonal: &[f64], off_diagonal: &[f64], beta: f64) -> (f64, f64) {
    let m = diagonal.len();
    let matrix = DMatrix::from_fn(m, m, |i, j| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => off_diagonal[i.min(j)],
        _ => 0.0,
    });
    let eigen = matrix.symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    (eigen.eigenvalues[largest], (beta * eigen.eigenvectors[(m - 1, largest)]).abs())
}

/// Divides v by its Euclidean norm, unless that is zero. Returns the norm.
pub(crate) fn normalize(v: &mut [f64]) -> f64 {
    let norm = vectors::norm(v);
    if norm > 0.0 {
        vectors::update(v, |_, v| *v /= norm);
    }
    norm
}

/// Returns a number in ±½ from a counter (the finaliser of SplitMix64, Steele et al. 2014).
pub(crate) fn noise(k: u64) -> f64 {
    let mut z = (k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as f64 / u64::MAX as f64 - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A diagonal matrix.
    struct Diagonal(Vec<f64>);

    impl SymmetricOperator for Diagonal {
        fn apply(&mut self, v: &[f64], out: &mut [f64]) -> Result<(), SolverError> {
            vectors::fill(out, |k| self.0[k] * v[k]);
            Ok(())
        }

        fn product(&self, a: &[f64], v: &[f64]) -> f64 {
            vectors::dot(a, v)
        }

        fn normalize(&mut self, v: &mut [f64]) -> f64 {
            normalize(v)
        }
    }

    /// One eigenvalue apart from a broad spectrum is found wherever its vector is, also where the start vector hardly has it.
    #[test]
    fn one_stiff_vector_is_not_missed() {
        for n in [24, 300] {
            for place in 0..n {
                let mut values: Vec<f64> = (0..n).map(|k| 1e-3 + (k as f64 / n as f64).powi(2)).collect();
                values[place] = 2.0;
                let found = highest(&mut Diagonal(values), n, 0.1).unwrap();
                let square = found.omega.powi(2);
                assert!(1.9 < square && square < 2.3, "{place} of {n}: {square} after {}", found.iterations);
            }
        }
    }
}
