//! How the implicit equations of a step are solved.

/// How implicit equations are solved.
#[derive(Debug, Clone, PartialEq)]
pub struct SolverOptions {
    /// Relative tolerance of every implicit solve in the energy norm; 1e-14 means to round-off.
    pub tolerance: f64,
    /// Which linear solver.
    pub linear: LinearSolver,
    /// Fill [`StepReport::energy`](crate::StepReport::energy): a few energies a step more.
    pub ledger: bool,
    /// Newton iterations after which a step has failed.
    pub max_iterations: u32,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self { tolerance: 1e-6, linear: LinearSolver::Auto, ledger: false, max_iterations: 100 }
    }
}

/// How linear systems are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinearSolver {
    /// The cheaper of the two by counted work.
    #[default]
    Auto,
    /// Sparse Cholesky factor, in single precision where Newton's method corrects what that leaves.
    Cholesky,
    /// Sparse Cholesky factor, in double precision in any case.
    CholeskyDouble,
    /// Preconditioned conjugate gradients.
    Pcg,
}

impl LinearSolver {
    /// The name in a scene file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Cholesky => "cholesky",
            Self::CholeskyDouble => "cholesky-double",
            Self::Pcg => "pcg",
        }
    }
}
