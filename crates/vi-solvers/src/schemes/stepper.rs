//! The contract of a time integrator: one step of a system, counted work, and a memory from which a run continues bit
//! for bit.

use vi_core::{Impulse, State, StepEnergy, System};

use crate::assemble::stencil_forces::SeeForces;
use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::memory::StepperMemory;
use crate::newton::budget::Budget;
use crate::work::Work;

/// A time integrator with everything that it keeps between steps.
pub trait Stepper: Send {
    /// Advances `state` by h (s, > 0).
    ///
    /// # Errors
    /// Returns a [`StepError`] with the facts; `state` is then unchanged to the bit. The next steps have the bits that they would
    /// have had without the attempt once the [`Stepper::memory`] from before it is restored.
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError>;

    /// Returns whether several steps of this system are cheaper together, by [`Stepper::steps`], than one by one.
    fn joins_steps(&self, _system: &System) -> bool {
        false
    }

    /// Advances `state` by `count` steps of h at once, to the same bits as that many calls of [`Stepper::step`].
    /// Returns `None` and changes nothing if the scheme does not join steps of this system, or if a step fails.
    /// Single steps then tell which one and why.
    fn steps(&mut self, _system: &System, _state: &mut State, _h: f64, _count: u32) -> Option<StepReport> {
        None
    }

    /// Returns all work done so far.
    fn work(&self) -> Work;

    /// Returns the costs of the parts of its work on the reference core.
    fn unit_costs(&self, system: &System) -> UnitCosts {
        UnitCosts::explicit(system)
    }

    /// Sets the budget of the next steps. Schemes that solve no equations ignore it.
    fn set_budget(&mut self, _budget: Budget) {}

    /// Returns everything besides (t, q, p) on which the bits of the next step depend.
    fn memory(&self) -> StepperMemory;

    /// Restores the [`Stepper::memory`] of an equal stepper. The run then continues bit for bit. Work counts start
    /// from zero.
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if the memory does not belong to this scheme and system, or an error of the
    /// factorisation that it requires.
    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError>;

    /// Keeps `state`, and the data on which its next steps depend, in the memory of other processes; replaces the state
    /// that was kept before. Returns false and keeps nothing if no other process shares the system.
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if the data to be kept do not belong to this scheme and system.
    fn keep(&mut self, _state: &State) -> Result<bool, SolverError> {
        Ok(false)
    }

    /// Goes back to the state that [`Stepper::keep`] kept; `state` becomes that state. As after [`Stepper::restore`], the run continues
    /// from there bit for bit, and work counts start from zero.
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if it keeps none.
    fn go_back(&mut self, _state: &mut State) -> Result<(), SolverError> {
        Err(SolverError::Memory { missing: "a state to go back to" })
    }

    /// Marks the current state, so that [`Stepper::return_to_mark`] can go back to it. Replaces the last mark. Explicit
    /// schemes do nothing, because an interval with contact must not be repeated with another number of explicit steps.
    fn mark(&mut self) {}

    /// Restores the memory of live terms at [`Stepper::mark`]: friction, and impulses and gaps that were not taken. The
    /// caller restores the state. Unlike after [`Stepper::restore`], the next steps agree with those from the mark only
    /// to the tolerance of the solver, and need no new factor.
    fn return_to_mark(&mut self) {}

    /// Returns the linear solver of its steps and the reason for it; `None` before the first solve and for explicit
    /// schemes.
    fn linear_solver(&self) -> Option<&str> {
        None
    }

    /// Returns how often the ordering and layout of a matrix were computed: once, and again when live terms change
    /// its pattern.
    fn analyses(&self) -> u64 {
        0
    }

    /// Returns ∂V/∂x (N, all coordinates) at the end of the last step, if the scheme knows it without further cost.
    fn gradient(&self) -> Option<&[f64]> {
        None
    }

    /// Returns whether it has evaluated the terms at the end of the last step. If not, the end may lie outside the domain
    /// of a term.
    fn sees_end(&self) -> bool {
        self.gradient().is_some()
    }

    /// Returns q̇ at a state, if the scheme knows it and M⁻¹p would need a solve (consistent mass).
    fn velocity(&self, _state: &State) -> Option<&[f64]> {
        None
    }

    /// Returns the energy that live terms store between steps besides V, J, for example the stretched bristles of
    /// friction.
    fn stored_energy(&self) -> f64 {
        0.0
    }

    /// Returns the impulses between parts of live terms since the last call, N s; `None` if the scheme does not know
    /// them. If the terms act at the end of a step but the momenta do not change by the forces there, returns the
    /// forces of the last step times the duration of all steps since the last call.
    fn take_impulses(&mut self) -> Option<Vec<Impulse>> {
        None
    }

    /// Calls `see` with the forces that live terms had over the last step, stencil by stencil. If the step was made in parts, it is the last
    /// part. Terms that act between both ends of a step have their mean forces, others those at its end. Returns false, without a call, if
    /// the scheme knows no more than the potential of the terms does, or has not made a step since it was restored.
    fn see_live_forces(&self, _see: &mut SeeForces<'_>) -> bool {
        false
    }

    /// Returns the smallest gap (m) of the pairs that acted in the steps since the last call: infinite if no pair acted,
    /// `None` if the scheme does not know it.
    fn take_smallest_gap(&mut self) -> Option<f64> {
        None
    }

    /// Returns messages for the user about the steps since the last call, e.g. about a limit point.
    fn take_findings(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// The results of one step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct StepReport {
    /// Newton iterations (0 for explicit schemes and for a body at rest in equilibrium).
    pub iterations: u32,
    /// The contributions to the change of total energy; zero unless
    /// [`SolverOptions::ledger`](crate::SolverOptions::ledger).
    pub energy: StepEnergy,
    /// The work of this step alone.
    pub work: Work,
}

/// A failed step. The state is unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the step from t = {t} s with h = {h} s failed: {cause}")]
pub struct StepError {
    /// Time at the start of the step, s.
    pub t: f64,
    /// The step, s.
    pub h: f64,
    /// The cause of the failure.
    pub cause: SolverError,
}

impl StepError {
    /// Returns whether the step was abandoned on request; see [`SolverError::Interrupted`].
    pub fn is_interruption(&self) -> bool {
        self.cause.is_interruption()
    }

    /// Returns whether a smaller step may succeed. It may if the state left the domain of a term or the nonlinear
    /// solve did not converge or left the constraints; it cannot if the state at the start is already invalid.
    pub fn smaller_step_may_help(&self) -> bool {
        matches!(
            self.cause,
            SolverError::Term { at_start: false, .. }
                | SolverError::NotFinite { at_start: false, .. }
                | SolverError::NoConvergence { .. }
                | SolverError::Budget { .. }
                | SolverError::Crossing { .. }
                | SolverError::UnresolvedContact { .. }
                | SolverError::NotPositiveDefinite(_)
                | SolverError::NegativeCurvature { .. }
                | SolverError::ConjugateGradients { .. }
                | SolverError::Residual { .. }
                | SolverError::Singular { .. }
                | SolverError::Narrow { .. }
                | SolverError::ConstraintDefect { .. }
        )
    }
}
