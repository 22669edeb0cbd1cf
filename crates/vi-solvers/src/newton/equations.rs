//! What Newton's method asks of the equations of an implicit step, and what a solve works with.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::assemble::hessian::HessianEvaluation;
use crate::error::SolverError;
use crate::newton::inverse::{Inverse, Reason};
use crate::newton::start::Start;

/// Equations R(w) = 0 with a symmetric positive definite model A ≈ ∂R/∂w.
pub(crate) trait Equations {
    /// c of the model A = M + cK.
    fn coefficient(&self) -> f64;
    /// Is A with K at the unknowns ∂R/∂w itself?
    fn model_is_exact(&self) -> bool {
        true
    }
    /// Returns whether A leaves out parts of ∂R/∂w, such as the turn of contact normals: then these limit convergence,
    /// however new the K in it is.
    fn model_is_partial(&self) -> bool {
        false
    }
    /// Does A stand for the coupled equations of several stages? Then the splitting limits convergence, however
    /// new the K in it is.
    fn splits_stages(&self) -> bool {
        false
    }
    /// The unknowns, to be kept.
    fn unknowns(&self) -> &[f64];
    /// Sets the unknowns to ones that were kept.
    fn go_to(&mut self, unknowns: &[f64]);
    /// Sets the unknowns.
    fn start(&mut self, start: Start);
    /// Shortens the way from where the step begins to where the iteration does, so that no term is left behind its limit.
    fn shorten_start(&mut self, _system: &System, _evaluator: &mut Evaluator) {}
    /// The largest part of the last correction that the terms allow, in (0, 1].
    fn largest_step(&mut self, _system: &System, _evaluator: &mut Evaluator) -> f64 {
        1.0
    }
    /// Leaves out of R what keeps its solution from minimising the merit, or puts it back; false where
    /// there is no such part.
    fn simplify(&mut self, _simple: bool) -> bool {
        false
    }
    /// Goes where K is taken.
    fn linearize(&mut self, system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError>;
    /// Evaluates −R at the unknowns.
    fn evaluate(&mut self, system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError>;
    /// Solves for the correction δ = −A⁻¹R; returns its energy −Rᵀδ/c, J.
    fn correct(&mut self, inverse: &mut Inverse, evaluator: &mut Evaluator) -> Result<f64, SolverError>;
    /// δ of the last correction, and Aδ.
    fn correction(&mut self) -> (&mut [f64], &[f64]);
    /// Sets the unknowns to those of the last correction plus `fraction` of δ.
    fn advance(&mut self, fraction: f64);
    /// −R·δ/c at the unknowns, J: minus the slope of the merit along δ.
    fn slope(&self) -> f64;
    /// Is there a function that the solution minimises?
    fn has_merit(&self) -> bool;
    /// That function over c, J; none where there is no such.
    fn merit(&mut self, system: &System, evaluator: &mut Evaluator) -> Option<f64>;
    /// The energy that errors are relative to, J.
    fn energy_scale(&self) -> f64;
    /// Is δ below the resolution of the numbers that hold the configuration?
    fn is_at_resolution(&self) -> bool;
}

/// A solve under way: the equations of a system, with its evaluator and an inverse of their model.
pub(crate) struct Solve<'a, E> {
    pub(crate) system: &'a System,
    pub(crate) evaluator: &'a mut Evaluator,
    pub(crate) inverse: &'a mut Inverse,
    pub(crate) equations: E,
}

impl<E: Equations> Solve<'_, E> {
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

    /// The largest part of the last correction that the terms allow.
    pub(super) fn largest_step(&mut self) -> f64 {
        match self.evaluator.limits_steps() {
            true => self.equations.largest_step(self.system, self.evaluator),
            false => 1.0,
        }
    }

    /// Factors the model where the forces were evaluated last.
    pub(super) fn factorize(&mut self, reason: Reason) -> Result<(), SolverError> {
        self.factorize_as(reason, HessianEvaluation::Exact)
    }

    /// The same with the Hessian of this kind to begin with.
    pub(super) fn factorize_as(
        &mut self,
        reason: Reason,
        kind: HessianEvaluation,
    ) -> Result<(), SolverError> {
        let c = self.equations.coefficient();
        self.inverse.make(self.system, self.evaluator, c, reason, kind)
    }
}
