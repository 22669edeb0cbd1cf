//! The contract of the equations of an implicit step with Newton's method, and the data of a solve.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::assemble::hessian::HessianEvaluation;
use crate::error::SolverError;
use crate::newton::budget::Budget;
use crate::newton::inverse::{Inverse, Reason};
use crate::newton::start::Start;
use crate::work::Work;

/// Equations R(w) = 0 with a symmetric positive definite model A ≈ ∂R/∂w.
pub(crate) trait Equations {
    /// Returns c of the model A = M + cK.
    fn coefficient(&self) -> f64;
    /// Returns whether A equals ∂R/∂w if K is taken at the unknowns.
    fn model_is_exact(&self) -> bool {
        true
    }
    /// Returns whether A omits parts of ∂R/∂w, such as the rotation of contact normals. Then these parts limit
    /// convergence, however recent K is.
    fn model_is_partial(&self) -> bool {
        false
    }
    /// Returns whether A omits the curvature of constraints. Then the corrections of one step contract by ratios that differ
    /// by orders of magnitude, and the last ratio does not bound the next one.
    fn omits_curvature(&self) -> bool {
        false
    }
    /// Returns the contraction of the error per iteration that A permits, however recent K is: above 0 if A stands for the
    /// coupled equations of several stages.
    fn least_contraction(&self) -> f64 {
        0.0
    }
    /// Returns the number of iterations with a factor whose contraction says little about it, because A stands for the coupled equations
    /// of several stages.
    fn transient_iterations(&self) -> u64 {
        0
    }
    /// Returns the unknowns, for [`Equations::go_to`].
    fn unknowns(&self) -> &[f64];
    /// Sets the unknowns to values from [`Equations::unknowns`].
    fn go_to(&mut self, unknowns: &[f64]);
    /// Sets the unknowns to a start.
    fn start(&mut self, start: Start);
    /// Shortens the path from the beginning of the step to the start of the iteration, so that it stays within the
    /// limits of all terms.
    fn shorten_start(&mut self, _system: &System, _evaluator: &mut Evaluator) {}
    /// Returns the largest fraction of the last correction that the terms allow, in (0, `most`]. Examines the path up
    /// to the fraction `most` only.
    fn largest_step(&mut self, _system: &System, _evaluator: &mut Evaluator, most: f64) -> f64 {
        most
    }
    /// Returns a bound on the length of sensible corrections if terms limit steps, m. Much longer ones would make candidates of all
    /// pairs.
    fn longest_correction(&self, _evaluator: &Evaluator) -> f64 {
        f64::INFINITY
    }
    /// If `simple`, omits the part of R that has no potential, or linearises it at the last evaluation, so that the
    /// solution of R = 0 minimises the merit; otherwise restores that part. Returns false if R has no such part.
    fn simplify(&mut self, _evaluator: &mut Evaluator, _simple: bool) -> bool {
        false
    }
    /// If `keeps`, moves all further iterates onto the manifold of the constraints, along which there is a merit;
    /// otherwise stops doing so. Does nothing without constraints.
    fn keep_constraints(&mut self, _keeps: bool) {}
    /// Shortens the whole step until the energy at its end, less the work of loads, is at most the energy at its
    /// beginning. Does so only if there is a merit and no prescribed coordinate moves. Evaluates −R at the new end.
    fn restrain(&mut self, _system: &System, _evaluator: &mut Evaluator) -> Result<(), SolverError> {
        Ok(())
    }
    /// Goes to the configuration at which K is evaluated.
    fn linearize(&mut self, system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError>;
    /// Evaluates −R at the unknowns.
    fn evaluate(&mut self, system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError>;
    /// Solves for the correction δ = −A⁻¹R; returns its energy −Rᵀδ/c, J.
    fn correct(&mut self, inverse: &mut Inverse, evaluator: &mut Evaluator) -> Result<f64, SolverError>;
    /// Returns δ of the last correction, and Aδ.
    fn correction(&mut self) -> (&mut [f64], &[f64]);
    /// Sets the unknowns to those of the last correction plus `fraction` · δ.
    fn advance(&mut self, fraction: f64);
    /// Returns −R·δ/c at the unknowns, J: minus the slope of the merit along δ.
    fn slope(&self) -> f64;
    /// Returns whether there is a merit, a function that the solution minimises.
    fn has_merit(&self) -> bool;
    /// Returns the merit over c, J; `None` if there is none.
    fn merit(&mut self, system: &System, evaluator: &mut Evaluator) -> Option<f64>;
    /// Returns the energy to which errors are relative, J.
    fn energy_scale(&self) -> f64;
    /// Returns whether δ is below the resolution of the numbers that hold the configuration.
    fn is_at_resolution(&self) -> bool;

    /// Returns factors that make lengths of the unknowns, m; `None` if all unknowns are lengths.
    fn levers(&self) -> Option<Vec<f64>> {
        None
    }
}

/// A solve in progress: the equations of a system, with its evaluator and an inverse of their model.
pub(crate) struct Solve<'a, E> {
    pub(crate) system: &'a System,
    pub(crate) evaluator: &'a mut Evaluator,
    pub(crate) inverse: &'a mut Inverse,
    pub(crate) equations: E,
    /// All work of the evaluator before this solve.
    before: Work,
}

impl<'a, E: Equations> Solve<'a, E> {
    pub(crate) fn new(
        system: &'a System,
        evaluator: &'a mut Evaluator,
        inverse: &'a mut Inverse,
        equations: E,
    ) -> Self {
        let before = evaluator.work;
        Self { system, evaluator, inverse, equations, before }
    }

    /// Returns an error if the work of this solve exceeds a budget. There is no budget near contact. Budgets count the
    /// work in matrices, which is then less than the work of contact; and the pairs that meet determine how hard the
    /// step is, rather than its length. A cloth of 40 × 40 cells on a sphere by `backward-euler` (5 ms, .5 s of motion)
    /// takes 42 instead of 67 s.
    pub(super) fn check(&self, budget: Budget) -> Result<(), SolverError> {
        if self.evaluator.has_pairs_near() {
            return Ok(());
        }
        budget.check(self.inverse.costs(), &(self.evaluator.work - self.before))
    }

    /// Sets the unknowns to those of a start, or as near to it as the terms allow.
    pub(super) fn start(&mut self, start: Start) {
        self.equations.start(start);
        if self.evaluator.limits_steps() {
            self.equations.shorten_start(self.system, self.evaluator);
        }
    }

    pub(super) fn linearize(&mut self) -> Result<(), SolverError> {
        self.equations.linearize(self.system, self.evaluator)
    }

    pub(super) fn evaluate(&mut self) -> Result<(), SolverError> {
        self.equations.evaluate(self.system, self.evaluator)
    }

    pub(super) fn merit(&mut self) -> Option<f64> {
        self.equations.merit(self.system, self.evaluator)
    }

    pub(super) fn correct(&mut self) -> Result<f64, SolverError> {
        self.equations.correct(self.inverse, self.evaluator)
    }

    /// Returns the largest fraction of the last correction that the terms allow.
    pub(super) fn largest_step(&mut self) -> f64 {
        if !self.evaluator.limits_steps() {
            return 1.0;
        }
        let sensible = self.sensible_part();
        self.equations.largest_step(self.system, self.evaluator, sensible)
    }

    /// Returns whether the last correction is longer than any sensible one: the factor lacks pairs that act, or is
    /// nearly singular.
    pub(super) fn is_correction_too_long(&mut self) -> bool {
        self.evaluator.limits_steps() && self.sensible_part() < 1.0
    }

    /// Returns the fraction of the last correction that is not longer than any sensible one.
    fn sensible_part(&mut self) -> f64 {
        let longest = self.equations.longest_correction(self.evaluator);
        let delta = self.equations.correction().0;
        (longest / self.system.coordinates().farthest(delta.iter().copied())).min(1.0)
    }

    /// Factors the model at the last evaluation of the forces.
    pub(super) fn factorize(&mut self, reason: Reason) -> Result<(), SolverError> {
        self.factorize_as(reason, HessianEvaluation::Exact)
    }

    /// Factors the model, starting with a Hessian of this kind.
    pub(super) fn factorize_as(
        &mut self,
        reason: Reason,
        kind: HessianEvaluation,
    ) -> Result<(), SolverError> {
        let c = self.equations.coefficient();
        self.inverse.make(self.system, self.evaluator, c, reason, kind)
    }
}
