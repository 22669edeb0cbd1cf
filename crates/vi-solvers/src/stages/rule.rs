//! What tells one-stage methods apart: û, c, the time of the stage, and what follows from its increment w.
//! Here is implicit midpoint; `comparison/` has the others. It must not know how the stage is solved.

use vi_core::{State, System};

use crate::forces::Forces;
use crate::inertia::Inertia;
use crate::{SolverError, StepperMemory};

/// What one step of a one-stage method is, for one coordinate: v is its velocity at the start, w the
/// stage increment, and `k` its index in the rule's own history.
pub(crate) trait Rule: Send + Sync {
    /// Scene name.
    fn name(&self) -> &'static str;
    /// c of the stage equation, s².
    fn coefficient(&self, h: f64) -> f64;
    /// Is Δp·v̄ = R·Δq/c − g·Δq to round-off, as for implicit midpoint?
    fn is_variational(&self) -> bool {
        false
    }
    /// Time of the stage, in units of h from the start.
    fn time(&self) -> f64;
    /// û − q₀.
    fn offset(&self, k: usize, v: f64, h: f64) -> f64;
    /// The changes of q and of velocity over the step, affine in w.
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64);
    /// Velocity at the stage, for forces that depend on it: as far between the two ends as the stage is.
    fn velocity(&self, k: usize, v: f64, w: f64, h: f64) -> f64 {
        v + self.time() * self.change(k, v, w, h).1
    }
    /// The solver's tolerance that serves the tolerance asked for.
    fn tolerance(&self, tolerance: f64) -> f64 {
        tolerance
    }
    /// Where multipliers take their directions and whether the momentum is made tangent at the end;
    /// none where the scheme has no place for constraints.
    fn multipliers(&self) -> Option<Multipliers> {
        None
    }
    /// Is there a force beside −∂V/∂q at the stage? Then the stage minimises nothing.
    fn has_correction(&self) -> bool {
        false
    }
    /// What is added to ∂V/∂q at the stage.
    fn correction(&mut self, _trial: &Trial<'_>, _out: &mut [f64]) {}
    /// Makes ready for a step from `state`, whose momentum has been opened: a history that does not belong
    /// to it is begun anew.
    fn open(
        &mut self,
        _: &System,
        _: &mut Forces,
        _: &Inertia,
        _: &State,
        _h: f64,
    ) -> Result<(), SolverError> {
        Ok(())
    }
    /// The step has been made: keeps what the next one needs.
    fn close(&mut self, _system: &System, _before: &State, _after: &State, _w: &[f64], _h: f64) {}
    /// What it keeps.
    fn remember(&self, _memory: &mut StepperMemory) {}
    /// Takes over what it kept.
    fn restore(&mut self, _memory: &StepperMemory) -> Result<(), SolverError> {
        Ok(())
    }
}

/// Where the multipliers of a step take their directions ∂g/∂q.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Multipliers {
    /// At the start, and at the end for the momentum: variational (Marsden & West 2001, §3.5).
    Ends,
    /// At the stage in the middle of the step, where they do no work on quadratic constraints: energy
    /// is kept (Gonzalez 1999). The momentum is tangent in the mean of its ends.
    Middle,
}

/// A stage that is being solved, evaluated at û + w.
pub(crate) struct Trial<'a> {
    pub(crate) system: &'a System,
    pub(crate) forces: &'a Forces,
    pub(crate) start_q: &'a [f64],
    pub(crate) start_t: f64,
    pub(crate) h: f64,
    pub(super) offset: &'a [f64],
    pub(super) w: &'a [f64],
}

impl Trial<'_> {
    /// û + w − q₀ of coordinate k.
    pub(crate) fn increment(&self, k: usize) -> f64 {
        self.offset[k] + self.w[k]
    }
}

/// Linear × midpoint (Marsden & West 2001, §2.6.2): û = q₀ + (h/2) v₀, c = h²/4.
pub(crate) struct Midpoint;

impl Rule for Midpoint {
    fn name(&self) -> &'static str {
        "implicit-midpoint"
    }
    fn is_variational(&self) -> bool {
        true
    }
    fn coefficient(&self, h: f64) -> f64 {
        0.25 * h * h
    }
    fn time(&self) -> f64 {
        0.5
    }
    fn offset(&self, _k: usize, v: f64, h: f64) -> f64 {
        0.5 * h * v
    }
    fn multipliers(&self) -> Option<Multipliers> {
        Some(Multipliers::Ends)
    }
    fn change(&self, _k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        (h * v + 2.0 * w, 4.0 * w / h)
    }
}
