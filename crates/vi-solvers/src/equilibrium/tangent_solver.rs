//! Solves with the tangent of an equilibrium: a Cholesky factor, or conjugate gradients for large bodies.

use crate::error::{NotPositiveDefinite, SolverError};
use crate::linear::choice::{FACTOR_MEMORY_SHARE, memory_of_machine, rough_load, try_gradients};
use crate::linear::cost;
use crate::linear::factor::Factor;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::pcg::Pcg;
use crate::linear::pcg::block::Preconditioner;
use crate::options::LinearSolver;
use crate::work::Work;

/// A factor with fewer operations is taken without comparing: .1 s of the reference core.
const CONSIDER_FLOPS: f64 = 3e9;

/// Relative error in the energy norm of the solve by which the solvers are compared.
const TRIAL_ACCURACY: f64 = 1e-4;

/// Largest number of iterations of a solve. A cantilever of 200 × 5 × 5 cells takes 240 to 1e-6.
const LONGEST: u32 = 5_000;

/// Relative error in the energy norm of the solve that searches for negative curvature. Conjugate gradients find the lowest
/// eigenvectors of a random load before they converge to it.
const SEARCH_ACCURACY: f64 = 1e-6;

enum Kind {
    Factor(Box<Factor>),
    Gradients(Box<Pcg>),
}

/// Solves with A = K + D of one pattern, with a diagonal D.
pub(super) struct TangentSolver {
    kind: Kind,
    solution: Vec<f64>,
}

impl TangentSolver {
    /// Chooses the solver for matrices with the pattern of `a`, at these positions of the free coordinates, m. `mass` weights
    /// the random load by which the solvers are compared.
    ///
    /// # Errors
    /// Returns an error if a factor was asked for and its ordering failed.
    pub(super) fn new(
        choice: LinearSolver,
        a: &SymmetricMatrix,
        mass: &[f64],
        positions: &[f64],
        work: &mut Work,
    ) -> Result<Self, SolverError> {
        let kind = match choice {
            LinearSolver::Cholesky | LinearSolver::CholeskyDouble => Kind::Factor(Box::new(Factor::new(a)?)),
            LinearSolver::Pcg => gradients(a),
            LinearSolver::Auto => match Factor::new(a) {
                Ok(factor) => {
                    let facts = factor.facts();
                    let is_too_large = facts.bytes as f64 > FACTOR_MEMORY_SHARE * memory_of_machine();
                    let matrix = (mass, [].as_slice(), 1.0, a, positions);
                    let mut is_outdone = || {
                        let cost = cost::factorization(&facts);
                        try_gradients(matrix, TRIAL_ACCURACY, cost, work).is_some()
                    };
                    if is_too_large || (facts.flops > CONSIDER_FLOPS && is_outdone()) {
                        gradients(a)
                    } else {
                        Kind::Factor(Box::new(factor))
                    }
                }
                Err(SolverError::Symbolic { .. }) => gradients(a),
                Err(error) => return Err(error),
            },
        };
        Ok(Self { kind, solution: Vec::new() })
    }

    /// Returns whether ordering and layout belong to the pattern of `a`.
    pub(super) fn serves(&self, a: &SymmetricMatrix) -> bool {
        match &self.kind {
            Kind::Factor(factor) => factor.serves(a),
            Kind::Gradients(pcg) => pcg.serves(a),
        }
    }

    /// Returns the factor, if this is one.
    pub(super) fn factor(&mut self) -> Option<&mut Factor> {
        match &mut self.kind {
            Kind::Factor(factor) => Some(factor),
            Kind::Gradients(_) => None,
        }
    }

    /// Takes A = K + D at these positions; an empty D means zero.
    ///
    /// # Errors
    /// Returns an error if A was found not to be positive definite. Conjugate gradients may find it later.
    pub(super) fn prepare(
        &mut self,
        d: &[f64],
        k: &SymmetricMatrix,
        positions: &[f64],
    ) -> Result<(), NotPositiveDefinite> {
        match &mut self.kind {
            Kind::Factor(factor) => factor.factorize(d, 1.0, k),
            Kind::Gradients(pcg) => pcg.prepare(d, 1.0, k, positions).map(|_| ()),
        }
    }

    /// Replaces b by x = A⁻¹b, by conjugate gradients to the relative `accuracy` in the energy norm.
    ///
    /// # Errors
    /// Returns [`SolverError::Residual`] if a factor is too close to singular; [`SolverError::NegativeCurvature`] or
    /// [`SolverError::ConjugateGradients`].
    pub(super) fn solve(
        &mut self,
        b_to_x: &mut [f64],
        accuracy: f64,
        work: &mut Work,
    ) -> Result<(), SolverError> {
        work.solves += 1;
        match &mut self.kind {
            Kind::Factor(factor) => factor.solve(b_to_x).map(|_| ()),
            Kind::Gradients(pcg) => {
                self.solution.resize(b_to_x.len(), 0.0);
                let report = pcg.solve(b_to_x, &mut self.solution, accuracy, LONGEST)?;
                work.pcg_iterations += u64::from(report.iterations);
                b_to_x.copy_from_slice(&self.solution);
                Ok(())
            }
        }
    }

    /// Returns whether A, which was prepared without an error, is positive definite. A factor has shown it; conjugate gradients
    /// look for a direction of negative curvature by a solve with a random load.
    ///
    /// # Errors
    /// Returns [`SolverError::ConjugateGradients`].
    pub(super) fn is_definite(&mut self, mass: &[f64], work: &mut Work) -> Result<bool, SolverError> {
        if matches!(self.kind, Kind::Factor(_)) {
            return Ok(true);
        }
        match self.solve(&mut rough_load(mass), SEARCH_ACCURACY, work) {
            Ok(()) => Ok(true),
            Err(SolverError::NegativeCurvature { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }
}

fn gradients(a: &SymmetricMatrix) -> Kind {
    Kind::Gradients(Box::new(Pcg::new(a, Preconditioner::BlockIncompleteCholesky)))
}
