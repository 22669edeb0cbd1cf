//! What every time integrator promises: one step of a system, counted work, and a memory from
//! which a run continues bit for bit. It must not know any scheme.

use vi_core::{State, StepEnergy, System};

use crate::{SolverError, UnitCosts};

/// A time integrator with everything it keeps between steps.
pub trait Stepper: Send {
    /// Advances `state` by h (s, > 0).
    ///
    /// # Errors
    /// A [`StepError`] with the facts; `state` is then bit-identical to what it was.
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError>;

    /// Are steps of this system cheaper together, by [`Stepper::steps`], than one by one?
    fn joins_steps(&self, _system: &System) -> bool {
        false
    }

    /// Advances `state` by `count` steps of h at once, to the bits of as many calls of [`Stepper::step`]. None,
    /// with nothing changed, where the scheme does not join steps of this system, or where one of them fails:
    /// single steps then tell which and why.
    fn steps(&mut self, _system: &System, _state: &mut State, _h: f64, _count: u32) -> Option<StepReport> {
        None
    }

    /// Everything done so far.
    fn work(&self) -> Work;

    /// What the pieces of its work cost on the reference core.
    fn unit_costs(&self, system: &System) -> UnitCosts {
        UnitCosts::explicit(system)
    }

    /// Everything beyond (t, q, p) that the bits of the next step depend on.
    fn memory(&self) -> StepperMemory;

    /// Takes over what [`Stepper::memory`] of an equal stepper gave: the run then continues bit for
    /// bit. Work counts start from zero.
    ///
    /// # Errors
    /// [`SolverError::Memory`] where the memory is not of this scheme and system, or an error of
    /// the factorisation that it asks for.
    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError>;

    /// Which linear solver serves its steps, and why; none before the first solve and in explicit schemes.
    fn linear_solver(&self) -> Option<&str> {
        None
    }

    /// How often the ordering and layout of a matrix were made: once, and again when live terms change its pattern.
    fn analyses(&self) -> u64 {
        0
    }

    /// ∂V/∂x (N, all coordinates) at the end of the last step, where the scheme knows it anyway.
    fn gradient(&self) -> Option<&[f64]> {
        None
    }

    /// q̇ at a state, where the scheme knows it and M⁻¹p would be a solve (consistent mass).
    fn velocity(&self, _state: &State) -> Option<&[f64]> {
        None
    }

    /// What a reader should hear of the steps since the last call, e.g. of a limit point.
    fn take_findings(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// What one step did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct StepReport {
    /// Newton iterations (0 for explicit schemes and for a body at rest in balance).
    pub iterations: u32,
    /// What changed the total energy; zero unless [`SolverOptions::ledger`].
    pub energy: StepEnergy,
    /// The work of this step alone.
    pub work: Work,
}

/// A step that failed. The state is as it was before.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the step from t = {t} s with h = {h} s failed: {cause}")]
pub struct StepError {
    /// Time at the start of the step, s.
    pub t: f64,
    /// The step, s.
    pub h: f64,
    /// What went wrong.
    pub cause: SolverError,
}

impl StepError {
    /// Could a smaller step succeed? So it may where the state left the domain of a term or the
    /// nonlinear solve did not converge; not where the state at the start is already wrong.
    pub fn smaller_step_may_help(&self) -> bool {
        matches!(
            self.cause,
            SolverError::Term { at_start: false, .. }
                | SolverError::NotFinite { at_start: false, .. }
                | SolverError::NoConvergence { .. }
                | SolverError::NotPositiveDefinite(_)
                | SolverError::NegativeCurvature { .. }
                | SolverError::ConjugateGradients { .. }
                | SolverError::Residual { .. }
        )
    }
}

/// How implicit equations are solved.
#[derive(Debug, Clone, PartialEq)]
pub struct SolverOptions {
    /// Relative tolerance of every implicit solve in the energy norm; 1e-14 means to round-off.
    pub tolerance: f64,
    /// Which linear solver.
    pub linear: LinearSolver,
    /// Fill [`StepReport::energy`]: a few energies a step more.
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

macro_rules! work {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {
        /// Counts of work done.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[non_exhaustive]
        pub struct Work {
            $($(#[$doc])* pub $name: u64,)*
        }

        impl Work {
            /// Names and counts, in order.
            pub fn iter(&self) -> impl Iterator<Item = (&'static str, u64)> + use<> {
                [$((stringify!($name), self.$name)),*].into_iter()
            }

            /// Counts by their names; none where a name is unknown.
            pub fn from_counts<'a>(counts: impl IntoIterator<Item = (&'a str, u64)>) -> Option<Self> {
                let mut work = Self::default();
                for (name, count) in counts {
                    match name {
                        $(stringify!($name) => work.$name = count,)*
                        _ => return None,
                    }
                }
                Some(work)
            }
        }

        impl std::ops::AddAssign for Work {
            fn add_assign(&mut self, other: Self) {
                $(self.$name += other.$name;)*
            }
        }

        impl std::ops::Sub for Work {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self { $($name: self.$name - other.$name),* }
            }
        }
    };
}

work! {
    /// Steps made.
    steps,
    /// Evaluations of ∂V/∂x.
    gradients,
    /// Evaluations of V.
    energies,
    /// Evaluations of ∂²V/∂x².
    hessians,
    /// Numeric factorisations.
    factorizations,
    /// Of these: because there was none yet, or h had changed.
    factorizations_new,
    /// Of these: before a step, because the old factor had become dearer than a new one.
    factorizations_stale,
    /// Of these: inside a step that converged too slowly.
    factorizations_slow,
    /// Of these: full Newton iterations.
    factorizations_newton,
    /// Linear solves.
    solves,
    /// Iterations of conjugate gradients.
    pcg_iterations,
    /// Iterations of conjugate gradients for velocities from momenta, M⁻¹p (consistent mass).
    mass_iterations,
    /// Newton iterations.
    newton_iterations,
    /// Energies or residuals evaluated in line searches.
    line_searches,
    /// Hessians projected to be positive definite, where the exact one gave no factor or no good direction.
    projections,
    /// Steps whose cheap iteration failed and that full Newton steps down an energy solved.
    descents,
    /// Implicit steps whose prediction already satisfied the tolerance: nothing was solved.
    skipped,
}

/// Everything beyond (t, q, p) that the next step's bits depend on, as plain data for a checkpoint.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepperMemory {
    /// Scene name of the scheme.
    pub method: String,
    /// Named arrays.
    pub arrays: Vec<(String, Vec<f64>)>,
    /// Named counts.
    pub counts: Vec<(String, u64)>,
}

impl StepperMemory {
    /// The array of this name.
    ///
    /// # Errors
    /// [`SolverError::Memory`] where there is none.
    pub fn array(&self, name: &'static str) -> Result<&[f64], SolverError> {
        let found = self.arrays.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_slice()).ok_or(SolverError::Memory { missing: name })
    }

    /// The count of this name.
    ///
    /// # Errors
    /// [`SolverError::Memory`] where there is none.
    pub fn count(&self, name: &'static str) -> Result<u64, SolverError> {
        let found = self.counts.iter().find(|(key, _)| key == name);
        found.map(|&(_, value)| value).ok_or(SolverError::Memory { missing: name })
    }
}

/// Is `memory` that of the scheme `name`?
pub(crate) fn expect_method(memory: &StepperMemory, name: &'static str) -> Result<(), SolverError> {
    if memory.method == name { Ok(()) } else { Err(SolverError::Memory { missing: name }) }
}
