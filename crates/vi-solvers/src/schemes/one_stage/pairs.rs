//! A stage whose live terms list their pairs: complete tangents, and corrections that end before pairs meet.

use vi_core::System;

use super::complete_tangent::{CompleteTangent, Parts};
use super::rule::{MultiplierDirections, Rule};
use super::stage::{Stage, StageEquations, load_of};
use crate::assemble::evaluator::Evaluator;
use crate::assemble::free_path::{FreePath, make_uniform};
use crate::error::SolverError;
use crate::newton::inverse::Inverse;
use crate::newton::pair_equations::PairEquations;
use crate::schemes::constraint::multipliers::Multipliers;
use crate::unit_of_mass::per_unit_of_mass;
use crate::vectors;

impl<R: Rule> StageEquations<'_, R> {
    /// Returns whether live terms list pairs near the path that the velocities at the start predict for this step.
    pub(super) fn meets_pairs(&mut self, evaluator: &mut Evaluator) -> bool {
        let Stage { origin, offset, start_t, h, end_per_stage, .. } = &*self.stage;
        if !evaluator.acts_over_steps() {
            return false;
        }
        let end: Vec<f64> = origin.iter().zip(offset).map(|(q, offset)| q + end_per_stage * offset).collect();
        evaluator.meets_pairs(self.system, (origin, *start_t), (&end, start_t + h))
    }

    /// Returns whether all bodies are rigid, and constraints act along directions of the stage. The symmetric model omits the curvature of
    /// the constraints then, while the complete tangent is small and sparse. It lacks those of live terms that do not list pairs.
    pub(super) fn is_mechanism(&self) -> bool {
        let follows_stage = self.rule.multiplier_directions() == Some(MultiplierDirections::Stage);
        let is_rigid = self.stage.multipliers.as_ref().is_some_and(Multipliers::read_all);
        let is_listed = self.system.terms().live().iter().all(|term| term.lists_pairs());
        follows_stage && is_rigid && is_listed && self.complete_size().is_some()
    }

    /// Returns the complete tangent, and what it consists of.
    fn complete_tangent<'b>(
        &'b mut self,
        evaluator: &'b mut Evaluator,
    ) -> (&'b mut CompleteTangent, Parts<'b>) {
        let Stage { c, end_per_stage, multipliers, complete, .. } = &mut *self.stage;
        let (multipliers, c, end_per_stage) = (multipliers.as_ref(), *c, *end_per_stage);
        let (system, inertia) = (self.system, self.inertia);
        (complete, Parts { system, inertia, evaluator, multipliers, c, end_per_stage })
    }

    fn count_complete_factor(&self, evaluator: &mut Evaluator) {
        evaluator.work.factorizations += 1;
        evaluator.work.factorizations_newton += 1;
    }

    /// Shortens the change `delta` of w, node by node, until no pair meets on the path of the end of the step from that
    /// of `base`; if `from_start`, on its path from the beginning of the step. Returns whether it was not shortened.
    fn shorten(&self, evaluator: &mut Evaluator, base: &[f64], delta: &mut [f64], from_start: bool) -> bool {
        let Stage { origin, offset, start_t, h, .. } = &*self.stage;
        let coordinates = self.system.coordinates();
        // The path is that of the end of the step, or of the stage if pairs act by their gradient there.
        let (scale, t_end) = match evaluator.acts_over_steps() {
            true => (self.stage.end_per_stage, start_t + h),
            false => (1.0, self.stage.t),
        };
        let place = |change: &[f64], t: f64| {
            let end = |k: usize| origin[k] + scale * (offset[k] + base[k]) + change[k];
            let end: Vec<f64> = (0..base.len()).map(end).collect();
            coordinates.positions(&end, t)
        };
        let from = place(&vec![0.0; delta.len()], if from_start { *start_t } else { t_end });
        let mut path = FreePath {
            coordinates,
            from: &from,
            place: |change: &[f64]| place(change, t_end),
            meetings: |from: &[f64], to: &[f64]| evaluator.meetings(from, to),
        };
        vectors::update(delta, |_, delta| *delta *= scale);
        let is_whole = match from_start && coordinates.is_moving() {
            true => path.shorten_past_obstacles(delta, |_| ()),
            false => path.shorten(delta, |_| ()),
        };
        vectors::update(delta, |_, delta| *delta /= scale);
        is_whole
    }

    /// Shortens the way from the beginning of the step to the start of the iteration, node by node, until no pair meets on it.
    pub(super) fn shorten_path(&mut self, evaluator: &mut Evaluator) {
        let Stage { offset, w, .. } = &*self.stage;
        let still: Vec<f64> = offset.iter().map(|offset| -offset).collect();
        let mut delta: Vec<f64> = offset.iter().zip(w).map(|(offset, w)| offset + w).collect();
        if !self.shorten(evaluator, &still, &mut delta, true) {
            let Stage { w, base, .. } = &mut *self.stage;
            vectors::fill(w, |k| still[k] + delta[k]);
            base.copy_from_slice(w);
        }
    }
}

impl<R: Rule> PairEquations for StageEquations<'_, R> {
    fn end_per_stage(&self) -> f64 {
        self.stage.end_per_stage
    }

    fn pair_defect(&self, inverse: &Inverse, evaluator: &Evaluator, v: &[f64]) -> Option<Vec<f64>> {
        let pairs = evaluator.pairs()?;
        let mut out = vec![0.0; v.len()];
        let is_in_model = inverse.multiply_tangents(v, &mut out);
        if !is_in_model && pairs.is_empty() {
            return None;
        }
        let Stage { c, end_per_stage, .. } = *self.stage;
        vectors::update(&mut out, |_, value| *value *= -c);
        pairs.add_product(end_per_stage * c, v, &mut out);
        Some(out)
    }

    fn solve_change(
        &mut self,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        v: &mut [f64],
    ) -> Result<(), SolverError> {
        inverse.apply(evaluator, v)?;
        let Stage { c, multipliers, .. } = &mut *self.stage;
        match multipliers {
            Some(multipliers) => multipliers.project_change(*c, inverse, evaluator, v),
            None => Ok(()),
        }
    }

    fn add_change(
        &mut self,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        r: &[f64],
    ) -> Result<f64, SolverError> {
        let Stage { c, multipliers, correction, residual, .. } = &mut *self.stage;
        let mut change = r.to_vec();
        inverse.apply(evaluator, &mut change)?;
        if let Some(multipliers) = multipliers {
            return multipliers.add_change(*c, inverse, evaluator, &mut change, correction);
        }
        vectors::update(correction, |k, value| *value += change[k]);
        Ok(vectors::dot(residual, correction) / *c)
    }

    fn complete_size(&self) -> Option<usize> {
        let is_shared = self.system.terms().shared().is_some();
        let multipliers = match &self.stage.multipliers {
            Some(multipliers) => multipliers.count_of_independent()?,
            None => 0,
        };
        (!is_shared).then_some(self.stage.w.len() + multipliers)
    }

    fn factor_completely(&mut self, evaluator: &mut Evaluator) -> Result<(), SolverError> {
        self.count_complete_factor(evaluator);
        let (tangent, parts) = self.complete_tangent(evaluator);
        tangent.factor(parts)
    }

    fn correct_completely(&mut self, evaluator: &mut Evaluator) -> Result<f64, SolverError> {
        let Stage { w, base, residual, multipliers, complete: tangent, .. } = &mut *self.stage;
        let count = w.len();
        let mut load = residual.clone();
        if let Some(multipliers) = multipliers {
            multipliers.complete_rhs(&mut load);
        }
        base.copy_from_slice(w);
        let mut change = load.clone();
        if let Err(error) = tangent.solve(&mut change) {
            let (tangent, parts) = self.complete_tangent(evaluator);
            if !tangent.factor_anew(parts)? {
                return Err(error);
            }
            tangent.solve(&mut load)?;
            change = load;
            self.count_complete_factor(evaluator);
        }
        evaluator.work.solves += 1;
        let Stage { c, correction, residual, multipliers, .. } = &mut *self.stage;
        correction.copy_from_slice(&change[..count]);
        if let Some(multipliers) = multipliers {
            multipliers.change(*c, &change[count..], residual);
        }
        let load = load_of(residual, multipliers);
        Ok(vectors::dot(load, correction) / *c)
    }

    fn forces_size(&self, evaluator: &Evaluator) -> f64 {
        let Some(pairs) = evaluator.pairs() else { return 0.0 };
        let (c, sizes, free) = (self.stage.c, pairs.sizes(), self.system.coordinates().free());
        let forces: Vec<f64> = free.iter().map(|&dof| c * sizes[dof as usize]).collect();
        size_of(self.system, &forces)
    }

    fn round_off(&self, evaluator: &Evaluator) -> f64 {
        let Some(pairs) = evaluator.pairs() else { return 0.0 };
        let Stage { c, q, residual, multipliers, .. } = &*self.stage;
        let mut bound = vec![0.0; load_of(residual, multipliers).len()];
        pairs.add_bound(f64::EPSILON * c, q, &mut bound);
        size_of(self.system, &bound)
    }

    fn residual_size(&self) -> f64 {
        size_of(self.system, &self.stage.residual)
    }

    fn load_size(&self) -> f64 {
        let Stage { residual, multipliers, .. } = &*self.stage;
        size_of(self.system, load_of(residual, multipliers))
    }

    fn limit(&mut self, evaluator: &mut Evaluator, longest: f64, is_uniform: bool) -> bool {
        let mut delta = std::mem::take(&mut self.stage.correction);
        let whole = if is_uniform { delta.clone() } else { Vec::new() };
        let mut is_whole = true;
        let coordinates = self.system.coordinates();
        let mut first = 0;
        for node in coordinates.free().chunk_by(|a, b| a / 3 == b / 3) {
            let values = &mut delta[first..first + node.len()];
            first += node.len();
            let norm = values.iter().map(|value| value * value).sum::<f64>().sqrt();
            let length = self.stage.end_per_stage * coordinates.lever(node[0] / 3) * norm;
            if length > longest {
                values.iter_mut().for_each(|value| *value *= longest / length);
                is_whole = false;
            }
        }
        is_whole &= self.shorten(evaluator, &self.stage.base, &mut delta, false);
        if is_uniform {
            make_uniform(&whole, &mut delta);
        }
        self.stage.correction = delta;
        is_whole
    }

    fn can_lag(&self, evaluator: &Evaluator) -> bool {
        let is_plain = self.stage.multipliers.is_none() && !self.rule.has_correction();
        is_plain && evaluator.pairs_act_at_end()
    }

    fn lag(&mut self, evaluator: &mut Evaluator, at_start: bool) {
        self.hold_forces(evaluator, true);
        let Stage { origin, offset, w, start_t, h, .. } = &*self.stage;
        let end = |k: usize| if at_start { origin[k] } else { origin[k] + (offset[k] + w[k]) };
        let end: Vec<f64> = (0..w.len()).map(end).collect();
        let end_t = if at_start { *start_t } else { start_t + h };
        evaluator.lag_friction(self.system, (origin, *start_t), (&end, end_t));
    }

    fn end_lag(&mut self, evaluator: &mut Evaluator) {
        self.hold_forces(evaluator, false);
        evaluator.end_lag();
    }

    fn limit_start(&mut self, evaluator: &mut Evaluator) {
        self.shorten_path(evaluator);
    }
}

/// Returns the norm √(rᵀM⁻¹r) of a residual, with the lumped mass in a unit that is a power of two.
fn size_of(system: &System, r: &[f64]) -> f64 {
    let mass = system.free_mass();
    (per_unit_of_mass(mass) * vectors::sum(r.len(), |k| r[k] * r[k] / mass[k])).sqrt()
}
