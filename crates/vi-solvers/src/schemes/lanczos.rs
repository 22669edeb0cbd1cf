//! Lanczos' method for the highest frequency ω = √λ_max of an operator that is symmetric in an inner product. It needs only
//! products of the operator with vectors, and keeps two of its vectors.

use nalgebra::DMatrix;

use crate::error::SolverError;
use crate::vectors;

/// Largest number of Lanczos vectors.
const MAX_ITERATIONS: u32 = 120;

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
    let (mut previous, mut next) = (vec![0.0; n], vec![0.0; n]);
    let mut current: Vec<f64> = (0..n as u64).map(noise).collect();
    operator.normalize(&mut current);
    let mut matrix = Tridiagonal::new(n);
    loop {
        operator.apply(&current, &mut next)?;
        let (alpha, beta) = (operator.product(&next, &current), matrix.beta);
        vectors::update(&mut next, |k, next| *next -= alpha * current[k] + beta * previous[k]);
        let beta = operator.normalize(&mut next);
        if let Some(found) = matrix.enter(alpha, beta, accuracy) {
            return Ok(found);
        }
        std::mem::swap(&mut previous, &mut current);
        std::mem::swap(&mut current, &mut next);
    }
}

/// The tridiagonal matrix to which the operator on n unknowns is reduced.
pub(crate) struct Tridiagonal {
    n: usize,
    diagonal: Vec<f64>,
    off_diagonal: Vec<f64>,
    /// The norm of the last vector; 0 at first.
    pub(crate) beta: f64,
}

impl Tridiagonal {
    pub(crate) fn new(n: usize) -> Self {
        Self { n, diagonal: Vec::new(), off_diagonal: Vec::new(), beta: 0.0 }
    }

    /// Enters the diagonal entry α of an iteration and the norm β of its last vector. Returns the frequency if its relative error
    /// is at most `accuracy`, or if there are no more iterations.
    pub(crate) fn enter(&mut self, alpha: f64, beta: f64, accuracy: f64) -> Option<HighestFrequency> {
        self.diagonal.push(alpha);
        self.beta = beta;
        let (ritz, residual) = largest_ritz_value(&self.diagonal, &self.off_diagonal, beta);
        let iterations = self.diagonal.len() as u32;
        let is_enough = residual <= accuracy * ritz.abs()
            || beta == 0.0
            || self.diagonal.len() >= self.n
            || iterations == MAX_ITERATIONS;
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
