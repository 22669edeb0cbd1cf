//! Options for solving the implicit equations of a step.

use crate::interrupt::Interrupt;

/// Options for solving implicit equations.
#[derive(Debug, Clone, PartialEq)]
pub struct SolverOptions {
    /// Relative tolerance of every implicit solve in the energy norm; 1e-14 means to round-off.
    pub tolerance: f64,
    /// The linear solver.
    pub linear: LinearSolver,
    /// Whether to fill [`StepReport::energy`](crate::StepReport::energy); this costs a few more energies per step.
    pub ledger: bool,
    /// Whether schemes in which live terms act by their gradient sum the impulses between parts
    /// ([`Stepper::take_impulses`](crate::Stepper::take_impulses)); this costs one more evaluation of the terms per stage.
    pub impulses: bool,
    /// Number of Newton iterations after which a step fails.
    pub max_iterations: u32,
    /// The request that abandons a step in progress.
    pub interrupt: Interrupt,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            linear: LinearSolver::Auto,
            ledger: false,
            impulses: false,
            max_iterations: 100,
            interrupt: Interrupt::NEVER,
        }
    }
}

/// The method for linear systems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinearSolver {
    /// The cheaper of a factor and conjugate gradients, by counted work.
    #[default]
    Auto,
    /// A sparse Cholesky factor, in single precision if Newton's method corrects the error of a solve.
    Cholesky,
    /// A sparse Cholesky factor, always in double precision.
    CholeskyDouble,
    /// Preconditioned conjugate gradients.
    Pcg,
    /// Conjugate gradients of the ranks' own solver ([`Exchange::linear_solver`](vi_core::Exchange::linear_solver)).
    Petsc,
}

impl LinearSolver {
    /// Returns the name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Cholesky => "cholesky",
            Self::CholeskyDouble => "cholesky-double",
            Self::Pcg => "pcg",
            Self::Petsc => "petsc",
        }
    }

    /// Returns whether several ranks solve together.
    pub(crate) fn is_shared(self) -> bool {
        matches!(self, Self::Pcg | Self::Petsc)
    }
}
