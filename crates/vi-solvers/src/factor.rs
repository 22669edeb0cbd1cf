//! Sparse Cholesky factor of A = M + cK.

use crate::{NotPositiveDefinite, SolverError, SymmetricMatrix};

/// Sparse Cholesky factor.
pub struct Factor {}

/// Size and cost of a factor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FactorFacts {
    /// Entries of the factor.
    pub nnz: u64,
    /// Floating-point operations of a factorisation.
    pub flops: f64,
    /// Bytes read by one solve.
    pub solve_bytes: f64,
    /// Bytes held.
    pub bytes: u64,
    /// Dense column blocks.
    pub supernodes: usize,
}

impl Factor {
    /// Ordering and symbolic factorisation, once a pattern.
    ///
    /// # Errors
    /// Where the ordering fails.
    pub fn new(_pattern: &SymmetricMatrix) -> Result<Self, SolverError> {
        unimplemented!()
    }

    /// Factors A = M + cK with M = diag(mass) on the free coordinates; an empty mass is zero.
    ///
    /// # Errors
    /// Where a pivot is not positive.
    pub fn factorize(
        &mut self,
        _mass: &[f64],
        _c: f64,
        _k: &SymmetricMatrix,
    ) -> Result<(), NotPositiveDefinite> {
        unimplemented!()
    }

    /// Solves A x = b in place and returns ‖Ax − b‖/‖b‖.
    ///
    /// # Errors
    /// Where the residual is above 1e-8 after refinement.
    pub fn solve(&mut self, _rhs_to_solution: &mut [f64]) -> Result<f64, SolverError> {
        unimplemented!()
    }

    /// Size and cost.
    pub fn facts(&self) -> FactorFacts {
        unimplemented!()
    }
}
