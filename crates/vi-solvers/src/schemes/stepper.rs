//! What every time integrator promises: one step of a system, counted work, and a memory from which a run continues
//! bit for bit.

use vi_core::{Impulse, State, StepEnergy, System};

use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::memory::StepperMemory;
use crate::work::Work;

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

    /// Energy that live terms store between steps beside V, J: stretched bristles of friction.
    fn stored_energy(&self) -> f64 {
        0.0
    }

    /// Impulses between parts of live terms since the last call, N s.
    fn take_impulses(&mut self) -> Vec<Impulse> {
        Vec::new()
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
    /// What changed the total energy; zero unless [`SolverOptions::ledger`](crate::SolverOptions::ledger).
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
                | SolverError::Crossing
                | SolverError::NotPositiveDefinite(_)
                | SolverError::NegativeCurvature { .. }
                | SolverError::ConjugateGradients { .. }
                | SolverError::Residual { .. }
        )
    }
}
