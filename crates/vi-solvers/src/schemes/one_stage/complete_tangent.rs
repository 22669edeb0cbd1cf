//! Factors of the complete tangent of a stage: J = M + c ∂²V/∂q² with the tangents of pairs and of forces without a potential,
//! and with the constraints as further rows and columns if there are any.
//!
//! Without constraints the pattern of J is symmetric, and every row has its diagonal. LU factors by nested dissection serve then, and
//! for few constraints with their Schur complement. With many constraints, in small systems with constraints, and where such factors fail
//! because rows must be exchanged farther, general LU factors serve.

use vi_core::System;

use super::bordered::{Border, scale_to_units};
use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::assemble::pairs::Pairs;
use crate::error::SolverError;
use crate::linear::factor::lu::Lu;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::nodal_matrix::{Covector, NodalMatrix};
use crate::linear::unsymmetric::Unsymmetric;
use crate::schemes::constraint::multipliers::Multipliers;
use crate::schemes::constraint::units::Units;

/// Largest number of constraints with which factors of the tangent without them serve, of four rigid bodies. A box that falls onto a
/// block of 1800 nodes with friction takes 84 ms per iteration with them, and 430 ms with general factors.
const MOST_BORDERED: usize = 24;
/// Smallest number of equations with which such factors serve. A box that bounces on a floor (12 equations) takes 1.3 s with both. Over 24
/// runs of it in long steps, its momentum about the vertical changed by up to 8e-9 of the largest with these factors, and by 5e-9 with
/// general ones. A block of 225 equations under a box takes .86 of the time with these factors (median of five pairs).
const LEAST_BORDERED: usize = 200;

/// The complete tangent at the last call of [`CompleteTangent::factor`], with its factors.
#[derive(Default)]
pub(super) struct CompleteTangent {
    /// The tangent without constraints, in units of its diagonal if there is a border, and its factors.
    nodal: Option<(NodalMatrix, Lu)>,
    /// The constraints beside `nodal`, if there are any.
    border: Option<Border>,
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

    /// Returns the number of constraints; none if they depend on each other.
    fn constraint_count(&self) -> usize {
        self.multipliers.map_or(0, |multipliers| multipliers.count_of_independent().unwrap_or(0))
    }

    /// Returns whether factors of the tangent without constraints serve, because there are few constraints or none.
    fn has_few_constraints(&self) -> bool {
        let size = self.system.coordinates().free_count();
        self.multipliers.is_none_or(|multipliers| {
            let count = multipliers.count_of_independent();
            count.is_some_and(|count| count <= MOST_BORDERED && size >= LEAST_BORDERED)
        })
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
        if parts.has_few_constraints() && !matrices.is_empty() && self.factor_nodal(&parts, &matrices).is_ok()
        {
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
            Some((matrix, factors)) if !self.is_general => match &self.border {
                Some(border) => border.solve(matrix, factors, rhs),
                None => factors.solve(matrix, rhs),
            },
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
                pairs.for_each_tangent(&mut *each);
            }
        };
        // The curvature of constraints, as outer products of unit vectors.
        let curvatures = |each: &mut dyn FnMut(&Covector, &Covector)| {
            if let Some(multipliers) = parts.multipliers {
                multipliers.for_each_curvature(|i, j, value| each(&[(i, value)], &[(j, 1.0)]));
            }
        };
        let both = |each: &mut dyn FnMut(&Covector, &Covector)| {
            couplings(each);
            curvatures(each);
        };
        let (mut matrix, is_new) = NodalMatrix::covering(kept, &list, both, self.is_of_this_step)?;
        self.is_of_this_step = true;
        for (k, (factor, part)) in matrices.iter().enumerate() {
            matrix.add_symmetric(*factor, k, part);
        }
        if let Some(mass) = parts.mass() {
            matrix.add_diagonal(mass);
        }
        let factor = parts.end_per_stage * parts.c;
        couplings(&mut |a, b| matrix.add_outer(factor, a, b));
        curvatures(&mut |a, b| matrix.add_outer(parts.c, a, b));
        let units = parts.multipliers.map(|_| scale_to_units(&mut matrix));
        let mut factors = match factors {
            Some(factors) if !is_new => factors,
            _ => Lu::new(matrix.pattern())?,
        };
        let free_count = parts.system.coordinates().free_count();
        let outcome = factors.factorize(&matrix).and_then(|()| {
            let border = |(multipliers, units): (&Multipliers, Units)| {
                let rows: Vec<_> = multipliers.rows().map(<[_]>::to_vec).collect();
                let mut columns = vec![vec![0.0; free_count]; rows.len()];
                multipliers.for_each_direction(|free, multiplier, value| {
                    columns[multiplier as usize][free as usize] += value;
                });
                Border::new(&matrix, &factors, units, rows, columns)
            };
            parts.multipliers.zip(units).map(border).transpose()
        });
        self.nodal = Some((matrix, factors));
        self.border = outcome?;
        Ok(())
    }

    fn factor_general(
        &mut self,
        parts: &Parts<'_>,
        matrices: &[(f64, SymmetricMatrix)],
    ) -> Result<(), SolverError> {
        let matrix = &mut self.general;
        let count = parts.system.coordinates().free_count();
        matrix.clear(count + parts.constraint_count());
        matrices.iter().for_each(|(factor, part)| matrix.add_symmetric(*factor, part));
        for (k, &mass) in (0..).zip(parts.mass().into_iter().flatten()) {
            matrix.add(k, k, mass);
        }
        if let Some(pairs) = parts.pairs() {
            let factor = parts.end_per_stage * parts.c;
            pairs.for_each_tangent(|a, b| matrix.add_outer(factor, a, b));
        }
        if let Some(multipliers) = parts.multipliers {
            let first = count as u32;
            multipliers
                .for_each_direction(|free, multiplier, value| matrix.add(free, first + multiplier, value));
            multipliers.for_each_curvature(|i, j, value| matrix.add(i, j, parts.c * value));
            for (multiplier, row) in (first..).zip(multipliers.rows()) {
                row.iter().for_each(|&(free, value)| matrix.add(multiplier, free, value));
            }
        }
        matrix.factor()
    }
}
