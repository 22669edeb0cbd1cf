//! The differences between one-stage methods: û, c, the time of the stage, and the update from its increment w. This
//! file holds implicit midpoint; `comparison/` has the others.

use vi_core::{Scheme, State, StepSpan, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::memory::StepperMemory;

/// One step of a one-stage method for one coordinate: v is its velocity at the start, w the stage increment, and `k`
/// its index in the rule's own history.
pub(crate) trait Rule: Send + Sync {
    /// Returns the name in scene files.
    fn name(&self) -> &'static str;
    /// Returns c of the stage equation, s².
    fn coefficient(&self, h: f64) -> f64;
    /// Returns whether the change of kinetic energy, Δp·v̄ with the mean velocity v̄ of the step, equals R·Δq/c −
    /// g·Δq to round-off, as for implicit midpoint.
    fn works_on_mean_velocity(&self) -> bool {
        false
    }
    /// Returns whether the ledger books the works of forces in the middle of a step, because those at the stage would have a lower order than
    /// the scheme.
    fn books_in_middle(&self) -> bool {
        false
    }
    /// Returns the time of the stage in units of h from the start.
    fn time(&self) -> f64;
    /// Returns whether the stage is the end of the step.
    fn is_at_end(&self) -> bool {
        self.time() == 1.0
    }
    /// Returns whether momenta change by h times the forces at the end of the step.
    fn moves_by_end_forces(&self) -> bool {
        false
    }
    /// Returns û − q₀.
    fn offset(&self, k: usize, v: f64, h: f64) -> f64;
    /// Returns the changes of q and of velocity over the step; both are affine in w.
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64);
    /// Returns the velocity at the stage, for forces that depend on it. It interpolates between the two ends at the
    /// time of the stage.
    fn velocity(&self, k: usize, v: f64, w: f64, h: f64) -> f64 {
        v + self.time() * self.change(k, v, w, h).1
    }
    /// Returns the tolerance of the solver that achieves the requested tolerance.
    fn tolerance(&self, tolerance: f64) -> f64 {
        tolerance
    }
    /// Returns where multipliers take their directions and whether the momentum is made tangent at the end; `None` if
    /// the scheme does not accept constraints.
    fn multiplier_directions(&self) -> Option<MultiplierDirections> {
        None
    }
    /// Returns whether live terms that have a discrete gradient always use it between the ends of the step. The stage is then
    /// at the midpoint. Otherwise, terms with a potential alone act by its gradient at the stage, whose solution then minimises a
    /// function, and terms that dissipate act over the step: at its end if the stage is there.
    fn takes_discrete_gradients(&self) -> bool {
        false
    }
    /// Returns whether dampers of live terms act on the velocities at the end of the step. False for the drift of an
    /// explicit step: its end velocities belong to a part of the step and are not those of the body.
    fn damps_end(&self) -> bool {
        true
    }
    /// Returns a step of h (s) as live terms see it.
    fn span(&self, h: f64) -> StepSpan {
        StepSpan { duration: h, acts_at_end: self.is_at_end(), damps_end: self.damps_end() }
    }
    /// Returns whether a force besides −∂V/∂q acts at the stage. Then the stage does not minimise a function.
    fn has_correction(&self) -> bool {
        false
    }
    /// Writes the addition to ∂V/∂q at the stage.
    fn correction(&mut self, _trial: &Trial<'_>, _out: &mut [f64]) {}
    /// Returns the positions of all coordinates at the ends of the step of the last correction, m, if terms act by forces over the step.
    fn step(&self) -> Option<[&[f64]; 2]> {
        None
    }
    /// Returns the number of linear solves after which the solve of a step ends, whether it has converged or not; `None` to
    /// solve to the tolerance.
    fn solves(&self) -> Option<u32> {
        None
    }
    /// Returns Σ m Δw² of the change Δw of increments by the round-off of the last correction, kg m².
    fn correction_noise(&self) -> f64 {
        0.0
    }
    /// Returns the energy that the last correction brings to a step, J.
    fn corrected_energy(&self) -> f64 {
        0.0
    }
    /// Returns the work of the last correction along the prescribed coordinates over the step, J.
    fn prescribed_work(&self) -> f64 {
        0.0
    }
    /// Returns whether prescribed coordinates at the stage are the means of their values at both ends of the step. If
    /// not, they are their values at the time of the stage.
    fn takes_mean_of_ends(&self) -> bool {
        false
    }
    /// Prepares for a step from `state`, whose momentum has been opened. A history that does not belong to this state
    /// is discarded.
    fn open(
        &mut self,
        _: &System,
        _: &mut Evaluator,
        _: &Inertia,
        _: &State,
        _h: f64,
    ) -> Result<(), SolverError> {
        Ok(())
    }
    /// Records, after a step, the data that the next step needs.
    fn close(&mut self, _system: &System, _before: &State, _after: &State, _w: &[f64], _h: f64) {}
    /// Saves the rule's memory.
    fn save(&self, _memory: &mut StepperMemory) {}
    /// Restores the rule's memory.
    fn restore(&mut self, _memory: &StepperMemory) -> Result<(), SolverError> {
        Ok(())
    }
}

/// The configurations at which the multipliers of a step take their directions ∂g/∂q.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MultiplierDirections {
    /// At the start, and at the end for the momentum: variational (Marsden & West 2001, §3.5).
    Ends,
    /// At the stage. In the middle of the step they do no work on quadratic constraints: energy is kept (Gonzalez 1999), and the
    /// momentum is tangent in the mean of its ends. At the end of the step, they are those of backward differences for equations
    /// with constraints (Hairer & Wanner 1996, §VII.3).
    Stage,
}

/// A stage that is being solved, evaluated at û + w.
pub(crate) struct Trial<'a> {
    pub(crate) system: &'a System,
    pub(crate) evaluator: &'a Evaluator,
    pub(crate) start_q: &'a [f64],
    pub(crate) start_t: f64,
    pub(crate) h: f64,
    pub(super) offset: &'a [f64],
    pub(super) w: &'a [f64],
}

impl Trial<'_> {
    /// Returns û + w − q₀ of coordinate k.
    pub(crate) fn increment(&self, k: usize) -> f64 {
        self.offset[k] + self.w[k]
    }
}

/// The stage of linear × midpoint. Let c be the node of the quadrature, here ½. The trajectory at the node is q₀ +
/// c(q₁ − q₀), and the Legendre transforms of L_d (Marsden & West 2001, §2.6.2) give q₁ − q₀ = h v₀ + w/c and v₁ − v₀
/// = w/(c(1 − c)h), where w = −c(1 − c)h² M⁻¹∂V/∂q.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Midpoint {
    node: f64,
}

impl Midpoint {
    /// Returns the stage of a scheme with a linear trajectory and its only quadrature node in the middle; `None` for
    /// other schemes.
    pub(crate) fn of(scheme: &Scheme) -> Option<Self> {
        let is_linear = scheme.interpolation.degree() == 1;
        match scheme.quadrature.nodes() {
            &[node] if is_linear && scheme.is_symmetric() => Some(Self { node }),
            _ => None,
        }
    }

    /// Returns the stage of [`Scheme::implicit_midpoint`].
    pub(crate) const fn new() -> Self {
        Self { node: 0.5 }
    }
}

impl Rule for Midpoint {
    fn name(&self) -> &'static str {
        "implicit-midpoint"
    }
    fn works_on_mean_velocity(&self) -> bool {
        true
    }
    fn coefficient(&self, h: f64) -> f64 {
        self.node * (1.0 - self.node) * h * h
    }
    fn time(&self) -> f64 {
        self.node
    }
    fn offset(&self, _k: usize, v: f64, h: f64) -> f64 {
        self.node * h * v
    }
    fn takes_discrete_gradients(&self) -> bool {
        true
    }
    fn multiplier_directions(&self) -> Option<MultiplierDirections> {
        Some(MultiplierDirections::Ends)
    }
    fn change(&self, _k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        let c = self.node;
        (h * v + w / c, w / (c * (1.0 - c)) / h)
    }
}
