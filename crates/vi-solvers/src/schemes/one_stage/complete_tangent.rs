//! Factors of the complete tangent of a stage: J = M + c ∂²V/∂q² with the tangents of pairs and of forces without a potential,
//! and with the constraints as further rows and columns if there are any.
//!
//! Without constraints the pattern of J is symmetric, and every row has its diagonal. LU factors by nested dissection serve then.
//! With constraints, and where such factors fail because rows must be exchanged farther, general LU factors serve.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::assemble::pairs::Pairs;
use crate::error::SolverError;
use crate::linear::factor::lu::Lu;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::nodal_matrix::{Covector, NodalMatrix};
use crate::linear::unsymmetric::Unsymmetric;
use crate::schemes::constraint::multipliers::Multipliers;

/// The complete tangent at the last call of [`CompleteTangent::factor`], with its factors.
#[derive(Default)]
pub(super) struct CompleteTangent {
    /// The tangent without constraints, and its factors.
    nodal: Option<(NodalMatrix, Lu)>,
    general: Unsymmetric,
    /// Whether the last factors are those of `general`.
    is_general: bool,
    /// Whether the pattern of `nodal` belongs to this step. A pattern that belongs to an earlier step must not influence this one, as
    /// a run that is resumed here does not know it.
    is_of_this_step: bool,
}

/// What the tangent of a stage consists of.
pub(super) struct Parts<'a> {
    pub(super) system: &'a System,
    pub(super) inertia: &'a Inertia,
    pub(super) evaluator: &'a mut Evaluator,
    pub(super) multipliers: Option<&'a Multipliers>,
    /// The coefficient c of the stage.
    pub(super) c: f64,
    /// The change of the end of the step per change of the stage.
    pub(super) end_per_stage: f64,
}

impl Parts<'_> {
    /// Returns the summands c_k S_k that are symmetric matrices.
    fn symmetric(&mut self) -> Vec<(f64, SymmetricMatrix)> {
        let mut parts = Vec::new();
        let c = self.c;
        self.evaluator.for_each_hessian(self.system, &mut |factor, k| parts.push((factor * c, k.clone())));
        parts.extend(self.inertia.matrix().map(|mass| (1.0, SymmetricMatrix::clone(mass))));
        parts
    }

    /// Returns the lumped mass of each free coordinate; `None` if the mass is a matrix.
    fn mass(&self) -> Option<&[f64]> {
        self.inertia.matrix().is_none().then(|| self.system.free_mass())
    }

    fn pairs(&self) -> Option<&Pairs> {
        self.evaluator.pairs()
    }
}

impl CompleteTangent {
    /// Forgets what the steps before have left.
    pub(super) fn begin_step(&mut self) {
        self.is_of_this_step = false;
    }

    /// Factors the tangent at the last evaluation.
    ///
    /// # Errors
    /// Returns [`SolverError::Singular`] if the tangent is singular or not finite.
    pub(super) fn factor(&mut self, mut parts: Parts<'_>) -> Result<(), SolverError> {
        self.is_general = true;
        let matrices = parts.symmetric();
        let is_nodal = parts.multipliers.is_none() && !matrices.is_empty();
        if is_nodal && self.factor_nodal(&parts, &matrices).is_ok() {
            self.is_general = false;
            return Ok(());
        }
        self.factor_general(&parts, &matrices)
    }

    /// Replaces the right side by the solution for the last factors.
    ///
    /// # Errors
    /// Returns [`SolverError::Residual`] if it is too inaccurate; then [`CompleteTangent::factor_anew`] may help. Returns
    /// [`SolverError::Singular`] if general factors fail too.
    pub(super) fn solve(&self, rhs: &mut [f64]) -> Result<(), SolverError> {
        match &self.nodal {
            Some((matrix, factors)) if !self.is_general => factors.solve(matrix, rhs),
            _ => self.general.solve(rhs),
        }
    }

    /// Factors the tangent at the last evaluation for which factors by nested dissection are too inaccurate. Returns whether there are
    /// other factors than before.
    pub(super) fn factor_anew(&mut self, mut parts: Parts<'_>) -> Result<bool, SolverError> {
        if self.is_general {
            return Ok(false);
        }
        self.is_general = true;
        let matrices = parts.symmetric();
        self.factor_general(&parts, &matrices)?;
        Ok(true)
    }

    fn factor_nodal(
        &mut self,
        parts: &Parts<'_>,
        matrices: &[(f64, SymmetricMatrix)],
    ) -> Result<(), SolverError> {
        let (kept, factors) = self.nodal.take().unzip();
        let list: Vec<&SymmetricMatrix> = matrices.iter().map(|(_, matrix)| matrix).collect();
        let couplings = |each: &mut dyn FnMut(&Covector, &Covector)| {
            if let Some(pairs) = parts.pairs() {
                pairs.for_each_tangent(each);
            }
        };
        let (mut matrix, is_new) = NodalMatrix::covering(kept, &list, couplings, self.is_of_this_step)?;
        self.is_of_this_step = true;
        for (k, (factor, part)) in matrices.iter().enumerate() {
            matrix.add_symmetric(*factor, k, part);
        }
        if let Some(mass) = parts.mass() {
            matrix.add_diagonal(mass);
        }
        let factor = parts.end_per_stage * parts.c;
        couplings(&mut |a, b| matrix.add_outer(factor, a, b));
        let mut factors = match factors {
            Some(factors) if !is_new => factors,
            _ => Lu::new(matrix.pattern())?,
        };
        let outcome = factors.factorize(&matrix);
        self.nodal = Some((matrix, factors));
        outcome
    }

    fn factor_general(
        &mut self,
        parts: &Parts<'_>,
        matrices: &[(f64, SymmetricMatrix)],
    ) -> Result<(), SolverError> {
        let matrix = &mut self.general;
        let count = parts.system.coordinates().free_count();
        let constraints =
            parts.multipliers.map_or(0, |multipliers| multipliers.count_of_independent().unwrap_or(0));
        matrix.clear(count + constraints);
        matrices.iter().for_each(|(factor, part)| matrix.add_symmetric(*factor, part));
        for (k, &mass) in (0..).zip(parts.mass().into_iter().flatten()) {
            matrix.add(k, k, mass);
        }
        if let Some(pairs) = parts.pairs() {
            let factor = parts.end_per_stage * parts.c;
            pairs.for_each_tangent(|a, b| matrix.add_outer(factor, a, b));
        }
        if let Some(multipliers) = parts.multipliers {
            multipliers.complete(parts.c, matrix, count);
        }
        matrix.factor()
    }
}
