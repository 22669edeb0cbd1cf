//! The sum of the Hessians of fixed and live terms, whose pattern is the union of both. The union is built again only when an
//! entry appears outside it.

use super::LiveSum;
use crate::assemble::hessian::HessianEvaluation;
use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::matrix_sum::MatrixSum;

impl LiveSum {
    /// Returns the Hessian of all terms, given the Hessian `fixed` of the fixed ones. For a step with two ends and
    /// its stage at `x` it contains the tangents of discrete gradients.
    pub(crate) fn hessian<'a>(
        &'a mut self,
        fixed: &'a SymmetricMatrix,
        x: &[f64],
        t: f64,
        kind: HessianEvaluation,
        ends: Option<[&[f64]; 2]>,
    ) -> Result<&'a SymmetricMatrix, SolverError> {
        // Terms that act by their gradient act at `x`, which may be far from the ends that were set last.
        match ends.filter(|_| self.splits) {
            Some([start, end]) => {
                self.tighten(start, end);
                self.follow(start, Some(end));
                self.place(start, end);
            }
            None => self.follow(x, None),
        }
        if self.union.is_none() && self.state.pattern != self.state.region {
            // The run that this one continues built the pattern at another place.
            self.restore_pattern(fixed, x, t, ends.is_some())?;
        }
        let factor = ends.map(|_| self.end_per_stage());
        let Self { near, lagged, lagged_union, union, state, pair, patterns, .. } = self;
        let Some(near) = near else { return Ok(fixed) };
        if let Some(lagged) = lagged {
            let parts = [fixed, near.whole.hessian(x, t, kind), lagged.hessian(x, t, kind)];
            let (union, _) = MatrixSum::covering(lagged_union, &parts)?;
            return Ok(union.combine(&parts.map(|part| (1.0, part))));
        }
        let parts = near.hessians(fixed, x, pair, t, kind, factor);
        let matrices: Vec<&SymmetricMatrix> = parts.iter().map(|part| part.1).collect();
        let (union, is_new) = MatrixSum::covering(union, &matrices)?;
        if is_new {
            *patterns += 1;
            state.pattern.clone_from(&state.region);
        }
        Ok(union.combine(&parts))
    }

    /// Returns the Hessian of the live terms alone, and the number of their stencils; `None` if there are none.
    pub(crate) fn own_hessian(&mut self, x: &[f64], t: f64) -> Option<(&SymmetricMatrix, usize)> {
        self.follow(x, None);
        let count = self.candidate_count();
        let near = self.near.as_mut().filter(|_| count > 0)?;
        Some((near.whole.hessian(x, t, HessianEvaluation::Exact), count))
    }

    /// Returns the Hessian of the terms that act by their gradient, if terms with a discrete gradient are kept apart.
    pub(crate) fn plain_hessian(&mut self, x: &[f64], t: f64) -> Option<&SymmetricMatrix> {
        self.follow(x, None);
        let [plain, _] = self.near.as_mut()?.parts.as_mut()?;
        Some(plain.hessian(x, t, HessianEvaluation::Exact))
    }

    /// Returns the tangents of the discrete gradients over the open step; `None` if there are none.
    pub(crate) fn tangents_over(&mut self, start: &[f64], end: &[f64]) -> Option<&SymmetricMatrix> {
        self.follow(start, Some(end));
        self.place(start, end);
        let Self { near, pair, .. } = self;
        let [_, discrete] = near.as_mut()?.parts.as_mut()?;
        Some(discrete.hessian(pair, 0.0, HessianEvaluation::Exact))
    }

    /// Returns the parts of the last Hessian that come from terms with a discrete gradient, as matrices with their
    /// factors.
    pub(crate) fn last_tangents(&self) -> Vec<(f64, &SymmetricMatrix)> {
        let Some(near) = &self.near else { return Vec::new() };
        let parts = match (&self.lagged, &near.parts) {
            (Some(lagged), _) => vec![(1.0, near.whole.last_hessian()), (1.0, lagged.last_hessian())],
            (None, Some([_, discrete])) => vec![(self.end_per_stage(), discrete.last_hessian())],
            (None, None) => Vec::new(),
        };
        parts.into_iter().filter_map(|(factor, matrix)| Some((factor, matrix?))).collect()
    }

    fn restore_pattern(
        &mut self,
        fixed: &SymmetricMatrix,
        x: &[f64],
        t: f64,
        has_ends: bool,
    ) -> Result<(), SolverError> {
        if self.state.pattern.about.is_empty() {
            return Ok(());
        }
        let factor = has_ends.then(|| self.end_per_stage());
        let Ok(mut near) = self.ask(&self.state.pattern, self.state.pattern.tube().as_ref()) else {
            return Ok(());
        };
        let parts = near.hessians(fixed, x, &self.pair, t, HessianEvaluation::Exact, factor);
        let matrices: Vec<&SymmetricMatrix> = parts.iter().map(|part| part.1).collect();
        self.union = Some(MatrixSum::new(&matrices)?);
        self.patterns += 1;
        Ok(())
    }
}
