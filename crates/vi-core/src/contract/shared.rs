//! Terms whose stencils are divided among several processes (ranks).

use crate::contract::exchange::Traffic;

/// The sums of the fixed terms of a system that several ranks compute together. The first rank requests them; the
/// others wait for its requests.
///
/// All sums have the bits of one process. Only one caller may request sums at a time: components whose terms are shared
/// must not be evaluated in parallel.
pub trait SharedTerms: Send + Sync {
    /// Returns the energies at positions `x` (m, all coordinates) and time t (s): those of each run of stencils that a rank
    /// sums. Affine terms and runs without a free coordinate are left out.
    fn energies(&self, x: &[f64], t: f64) -> Vec<RunEnergy>;

    /// Replaces the positions `x` (m, all coordinates) by ∂V/∂x at time t (s) of every coordinate, N.
    fn gradient(&self, x: &mut [f64], t: f64);

    /// Returns the first stencil without a finite energy or gradient that a rank sums: index of the term, and stencil.
    fn first_fault(&self, x: &[f64], t: f64) -> Option<(usize, usize)>;

    /// Starts Lanczos' method for M^{-1/2} K M^{-1/2} at the free coordinates `q` and time t, by vectors that the ranks keep. Returns
    /// false if they do not know masses and supports.
    fn start_lanczos(&self, q: &[f64], t: f64, start: &LanczosStart<'_>) -> bool;

    /// Divides the last vector by its norm, which becomes the current one, and multiplies it. Writes the terms of the product of
    /// both, one per free coordinate.
    fn multiply_lanczos(&self, norm: f64, out: &mut [f64]);

    /// Subtracts α times the current vector and β times the one before from the product, which becomes the last vector. Writes
    /// the squares of its numbers.
    fn subtract_lanczos(&self, factors: [f64; 2], out: &mut [f64]);

    /// Returns whether the ranks also solve linear systems with A = aM + cK together, where K = ∂²V/∂q².
    fn solves(&self) -> bool;

    /// Prepares the solver for A with the factors [a, c] at positions `x` (m, all coordinates) and time t (s). If
    /// `is_projected`, the negative eigenvalues of the Hessian of every stencil are set to zero. Returns its costs, and a free
    /// coordinate at which A is not positive definite, if there is one.
    fn prepare(
        &self,
        x: &[f64],
        t: f64,
        factors: [f64; 2],
        is_projected: bool,
    ) -> (SolverFacts, Option<usize>);

    /// Writes the diagonal of the last K (free coordinates), N/m.
    fn diagonal(&self, out: &mut [f64]);

    /// Computes v ← A⁻¹v (free coordinates) by preconditioned conjugate gradients, to a relative error in the energy norm.
    fn solve(&self, v: &mut [f64], tolerance: f64, max_iterations: u32) -> SharedSolve;

    /// Returns messages for the user about the solves since the last call.
    fn take_findings(&self) -> Vec<String>;

    /// Returns what the first rank sends to others per gradient, without `x`.
    fn traffic(&self) -> Traffic;
}

/// The start of Lanczos' method by differences of gradients.
pub struct LanczosStart<'a> {
    /// The inverse of a unit of mass, which is a power of two, 1/kg.
    pub per_unit: f64,
    /// The largest displacement of a difference, m.
    pub displacement: f64,
    /// The first vector, by free coordinate.
    pub vector: &'a dyn Fn(usize) -> f64,
}

/// The outcome of a solve; only the first one has reached the tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SharedSolve {
    /// The solution is found.
    Converged {
        /// Number of iterations.
        iterations: u32,
    },
    /// The iterations did not suffice; the last iterate is a descent direction.
    TooMany {
        /// Number of iterations.
        iterations: u32,
        /// The relative error that was reached.
        residual: f64,
    },
    /// A is not positive definite; the last iterate is a descent direction.
    Negative {
        /// Number of iterations.
        iterations: u32,
        /// dᵀAd of the last direction d.
        curvature: f64,
    },
}

/// Cost of conjugate gradients, of all ranks together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SolverFacts {
    /// Bytes that one iteration moves.
    pub iteration_bytes: f64,
    /// Floating-point operations of one iteration.
    pub iteration_flops: f64,
    /// Bytes that the preparation moves.
    pub prepare_bytes: f64,
    /// Floating-point operations of the factor of the coarse matrix.
    pub coarse_flops: f64,
    /// Bytes of memory held.
    pub bytes: u64,
}

/// The energy of a run of stencils.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunEnergy {
    /// Index of the term.
    pub term: usize,
    /// The first stencil of the run.
    pub first: usize,
    /// The sum of the energies, J.
    pub sum: f64,
    /// The sum of the rounding errors of this sum, J.
    pub error: f64,
}
