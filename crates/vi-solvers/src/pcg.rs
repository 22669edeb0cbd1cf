//! Preconditioned conjugate gradients on nodal blocks.

use crate::{SolverError, SymmetricMatrix};

/// What stands in for A⁻¹.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preconditioner {
    /// The inverse of the diagonal blocks.
    BlockJacobi,
    /// Incomplete Cholesky factor on the pattern of A; falls back to `Ssor` where a pivot fails.
    BlockIncompleteCholesky,
    /// Symmetric block Gauss–Seidel.
    Ssor,
}

/// Conjugate gradients for A = M + cK.
pub struct Pcg {}

/// What a solve took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PcgReport {
    /// Iterations.
    pub iterations: u32,
    /// √(rᵀP⁻¹r) over its value at x = 0.
    pub residual: f64,
}

/// Cost of an iteration and of the preparation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PcgFacts {
    /// Bytes moved by one iteration.
    pub iteration_bytes: f64,
    /// Floating-point operations of one iteration.
    pub iteration_flops: f64,
    /// Bytes moved by the preparation.
    pub prepare_bytes: f64,
    /// Bytes held.
    pub bytes: u64,
}

impl Pcg {
    /// Maps and buffers, once a pattern.
    pub fn new(_pattern: &SymmetricMatrix, _preconditioner: Preconditioner) -> Self {
        unimplemented!()
    }

    /// Takes A = M + cK (M = diag(mass), empty: zero) and makes the preconditioner; returns the one made.
    ///
    /// # Errors
    /// Where a diagonal block is not positive definite.
    pub fn prepare(
        &mut self,
        _mass: &[f64],
        _c: f64,
        _k: &SymmetricMatrix,
    ) -> Result<Preconditioner, SolverError> {
        unimplemented!()
    }

    /// Solves A x = b from x = 0 until the residual in the norm of the preconditioner is below
    /// `tolerance` of its first value (an estimate of the relative error in the energy norm).
    ///
    /// # Errors
    /// Where it does not converge within `max_iterations`, or A is not positive definite.
    pub fn solve(
        &mut self,
        _rhs: &[f64],
        _x: &mut [f64],
        _tolerance: f64,
        _max_iterations: u32,
    ) -> Result<PcgReport, SolverError> {
        unimplemented!()
    }

    /// Cost and size.
    pub fn facts(&self) -> PcgFacts {
        unimplemented!()
    }
}
