//! Solves with the tangent of an equilibrium: a Cholesky factor, or conjugate gradients for large bodies.

use std::sync::Arc;

use vi_core::{SharedSolve, SharedTerms};

use crate::error::{NotPositiveDefinite, SolverError};
use crate::interrupt::Interrupt;
use crate::linear::cost;
use crate::linear::factor::Factor;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::model::Model;
use crate::linear::pcg::Pcg;
use crate::linear::pcg::block::Preconditioner;
use crate::linear::trial::{CONSIDER_FLOPS, describe, load_of_all_frequencies, too_large, try_gradients};
use crate::options::LinearSolver;
use crate::work::Work;

/// The number and accuracy of the solves that one matrix serves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Demand {
    /// Number of solves.
    pub(super) solves: f64,
    /// Their relative accuracy in the energy norm.
    pub(super) accuracy: f64,
}

impl Demand {
    /// One correction by Newton's method.
    pub(super) const CORRECTION: Self = Self { solves: 1.0, accuracy: 1e-4 };

    /// All corrections of a load step, by the tangent of a body whose K is the same everywhere. With conjugate gradients, a cantilever of
    /// 48 × 8 × 8 `hex20` takes five.
    pub(super) const CONSTANT: Self = Self { solves: 5.0, accuracy: 1e-4 };

    /// One correction with friction, by GMRES preconditioned by the matrix. A ball that is pressed into a block takes 4.2 solves.
    pub(super) const WITH_FRICTION: Self = Self { solves: 4.0, accuracy: 1e-8 };
}

/// Largest number of iterations of a solve. A cantilever of 200 × 5 × 5 cells takes 240 to 1e-6.
const LONGEST: u32 = 5_000;

/// Relative error in the energy norm of the solve that searches for negative curvature. Conjugate gradients find the lowest
/// eigenvectors of a random load before they converge to it.
const SEARCH_ACCURACY: f64 = 1e-6;

enum Kind {
    Factor(Box<Factor>),
    Gradients(Box<Pcg>),
    /// Conjugate gradients of several processes.
    Shared(Arc<dyn SharedTerms>, LinearSolver),
}

/// Solves with A = K + D of one pattern, with a diagonal D.
pub(super) struct TangentSolver {
    kind: Kind,
    /// The reason for this solver, in words.
    reason: String,
    solution: Vec<f64>,
}

/// The factor of a K that is the same everywhere, which serves later searches too.
pub(super) struct ConstantTangent {
    pub(super) solver: TangentSolver,
    /// The diagonal of K, N/m.
    pub(super) diagonal: Vec<f64>,
}

impl TangentSolver {
    /// Chooses the solver for matrices with the pattern of `a`, at these positions of the free coordinates, m, for this demand. `mass`
    /// weights the random load by which the solvers are compared.
    ///
    /// # Errors
    /// Returns an error if a factor was asked for and its ordering failed.
    pub(super) fn new(
        (choice, demand): (LinearSolver, Demand),
        a: &SymmetricMatrix,
        mass: &[f64],
        positions: &[f64],
        work: &mut Work,
    ) -> Result<Self, SolverError> {
        let (kind, reason) = match choice {
            LinearSolver::Cholesky | LinearSolver::CholeskyDouble => factored(Factor::new(a)?),
            LinearSolver::Pcg => (gradients(a), "pcg: asked for".to_owned()),
            LinearSolver::Petsc => return Err(SolverError::no_petsc()),
            LinearSolver::Auto => match Factor::new(a) {
                Ok(factor) => Self::compare((factor, demand), a, mass, positions, work),
                Err(error @ SolverError::Symbolic { .. }) => {
                    (gradients(a), format!("pcg: a factor is not possible: {error}"))
                }
                Err(error) => return Err(error),
            },
        };
        Ok(Self { kind, reason, solution: Vec::new() })
    }

    /// Returns the solver with a request that ends its solves by conjugate gradients.
    pub(super) fn interruptible(self, interrupt: &Interrupt) -> Self {
        let kind = match self.kind {
            Kind::Gradients(pcg) => Kind::Gradients(Box::new(pcg.interruptible(interrupt.clone()))),
            other => other,
        };
        Self { kind, ..self }
    }

    /// Returns the solver of processes that prepare and solve together by conjugate gradients.
    pub(super) fn shared(shared: &Arc<dyn SharedTerms>, linear: LinearSolver) -> Self {
        let kind = Kind::Shared(Arc::clone(shared), linear);
        Self { kind, reason: format!("{}: asked for", linear.name()), solution: Vec::new() }
    }

    /// Takes the factor, or conjugate gradients if they cost less for this demand or the factor is too large.
    fn compare(
        (factor, demand): (Factor, Demand),
        a: &SymmetricMatrix,
        mass: &[f64],
        positions: &[f64],
        work: &mut Work,
    ) -> (Kind, String) {
        let facts = factor.facts();
        if let Some(why) = too_large(&facts) {
            return (gradients(a), format!("pcg: {why}"));
        }
        if facts.flops <= CONSIDER_FLOPS {
            return factored(factor);
        }
        let cost = cost::factorization(&facts);
        let model = Model { mass: &[], c: 1.0, k: a, positions };
        match try_gradients(model, mass, demand.accuracy, cost / demand.solves, work) {
            Some([iterations, solve]) => {
                let (solve, cost, count) = (1e3 * solve, 1e3 * cost, demand.solves);
                let solves = if count == 1.0 {
                    "a solve takes".to_owned()
                } else {
                    format!("{count} solves take each")
                };
                let why = format!(
                    "pcg: {solves} {iterations} iterations, {solve:.0} ms of the reference core, against {cost:.0} ms for a factor"
                );
                (gradients(a), why)
            }
            None => factored(factor),
        }
    }

    /// Returns the solver that was chosen, a factor or conjugate gradients, and the reason.
    pub(super) fn choice(&self) -> (LinearSolver, &str) {
        let linear = match &self.kind {
            Kind::Factor(_) => LinearSolver::Cholesky,
            Kind::Gradients(_) => LinearSolver::Pcg,
            Kind::Shared(_, linear) => *linear,
        };
        (linear, &self.reason)
    }

    /// Returns whether ordering and layout belong to the pattern of `a`.
    pub(super) fn has_pattern_of(&self, a: &SymmetricMatrix) -> bool {
        match &self.kind {
            Kind::Factor(factor) => factor.has_pattern_of(a),
            Kind::Gradients(pcg) => pcg.has_pattern_of(a),
            Kind::Shared(..) => true,
        }
    }

    /// Returns the factor, if this is one.
    pub(super) fn factor(&mut self) -> Option<&mut Factor> {
        match &mut self.kind {
            Kind::Factor(factor) => Some(factor),
            Kind::Gradients(_) | Kind::Shared(..) => None,
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
            // The processes have prepared it when they assembled the matrix.
            Kind::Shared(..) => Ok(()),
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
            Kind::Shared(shared, _) => match shared.solve(b_to_x, accuracy, LONGEST) {
                SharedSolve::Converged { iterations } => {
                    work.pcg_iterations += u64::from(iterations);
                    Ok(())
                }
                SharedSolve::Negative { iterations, curvature } => {
                    Err(SolverError::NegativeCurvature { iterations, curvature })
                }
                SharedSolve::TooMany { iterations, residual } => {
                    Err(SolverError::ConjugateGradients { iterations, residual, tolerance: accuracy })
                }
            },
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
        match self.solve(&mut load_of_all_frequencies(mass), SEARCH_ACCURACY, work) {
            Ok(()) => Ok(true),
            Err(SolverError::NegativeCurvature { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }
}

fn factored(factor: Factor) -> (Kind, String) {
    let reason = describe(&factor.facts(), false);
    (Kind::Factor(Box::new(factor)), reason)
}

fn gradients(a: &SymmetricMatrix) -> Kind {
    Kind::Gradients(Box::new(Pcg::new(a, Preconditioner::BlockIncompleteCholesky)))
}
