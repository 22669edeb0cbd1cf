//! Keeps the iterates of a stage on the manifold of the constraints, so that the stage has a merit, and shortens steps
//! whose energy at the end exceeds the energy at the beginning.

use vi_core::System;

use super::{Stage, StageEquations, inertial_energy};
use crate::assemble::evaluator::Evaluator;
use crate::error::SolverError;
use crate::newton::equations::Equations;
use crate::newton::line_search::ENERGY_NOISE;
use crate::newton::start::Start;
use crate::schemes::constraint::multipliers::Multipliers;
use crate::schemes::one_stage::rule::Rule;
use crate::vectors;

/// The first fraction by which a step is shortened on trial if its end has too much energy. A pendulum with a cloth, at two
/// solves per step of 5 ms, had gained .24 J in one step, 4 % of its kinetic energy.
const FIRST_REMOVED: f64 = 1.0 / 64.0;

/// Number of trials between the fraction that is enough and one that is not. Without them a step that gains a millionth would lose
/// 1/64 of its velocity, however short it is.
const REFINEMENTS: u32 = 3;

impl Stage {
    /// Returns whether w is kept where the constraints are met.
    pub(super) fn is_kept(&self) -> bool {
        self.multipliers.as_ref().is_some_and(Multipliers::is_kept)
    }

    /// Returns whether constraints keep the stage from minimising a function.
    pub(super) fn is_bound(&self) -> bool {
        self.multipliers.as_ref().is_some_and(|multipliers| !multipliers.is_kept())
    }

    /// Returns why w did not reach the manifold of the constraints; `None` if it did, or if it is not kept there.
    pub(super) fn off_constraints(&self) -> Option<&SolverError> {
        self.multipliers.as_ref().and_then(Multipliers::failure)
    }

    /// Moves w to where the constraints are met if it is to be kept there: a start along the directions at the beginning of the step,
    /// a correction along those of its solve.
    pub(super) fn meet_constraints(&mut self, system: &System, is_start: bool) {
        let Self { multipliers, origin, offset, w, c, end_per_stage, start_t, .. } = self;
        let Some(multipliers) = multipliers.as_mut().filter(|multipliers| multipliers.is_kept()) else {
            return;
        };
        let end = |k: usize, w: f64| origin[k] + *end_per_stage * (offset[k] + w);
        match is_start {
            true => multipliers.place_start(system, *c, (origin, *start_t), end, w),
            false => multipliers.return_to_manifold(system, *c, end, w),
        }
    }
}

impl<R: Rule> StageEquations<'_, R> {
    /// Takes parts from the step until its end has no more energy than its beginning under the loads of the end: the potential of the stage
    /// decreases with each correction, but may still be far above its minimum where solves are few. Evaluates −R.
    pub(super) fn shorten_step(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
    ) -> Result<(), SolverError> {
        let reached = self.stage.w.clone();
        self.start(Start::Still);
        // Without motion, the merit is the energy at the beginning, under the loads of the end.
        let given = self.merit(system, evaluator).unwrap_or(f64::INFINITY);
        self.go_to(&reached);
        let allowed = given + ENERGY_NOISE * given.abs();
        let excess = self.end_energy(system, evaluator) - allowed;
        if excess.is_nan() || excess <= 0.0 {
            // With constraints, the start has changed their forces.
            return if self.stage.is_kept() { self.evaluate(system, evaluator) } else { Ok(()) };
        }
        let mut excess_without = |removed: f64| {
            let Stage { w, offset, .. } = &mut *self.stage;
            vectors::fill(w, |k| (1.0 - removed) * (offset[k] + reached[k]) - offset[k]);
            self.stage.meet_constraints(system, false);
            self.end_energy(system, evaluator) - allowed
        };
        // The largest fraction that is known not to be enough, and the smallest one that is, each with the excess of energy.
        let mut too_little = (0.0, excess);
        let mut enough = (FIRST_REMOVED, excess_without(FIRST_REMOVED));
        while enough.1 > 0.0 && enough.0 < 1.0 {
            too_little = enough;
            let more = 2.0 * enough.0;
            enough = (more, excess_without(more));
        }
        for _ in 0..REFINEMENTS {
            let ([from, over], [to, under]) = ([too_little.0, too_little.1], [enough.0, -enough.1]);
            let part = if over.is_finite() && under >= 0.0 { over / (over + under) } else { 0.5 };
            // A little more than at the zero of the chord, so that this is mostly enough.
            let removed = from + (0.95 * part + 0.05) * (to - from);
            match excess_without(removed) {
                excess if excess > 0.0 => too_little = (removed, excess),
                excess => enough = (removed, excess),
            }
        }
        excess_without(enough.0);
        self.evaluate(system, evaluator)
    }

    /// Returns the energy at the end of the step, where the stage is, with the velocity of the way there, J; infinity where the stage
    /// cannot be.
    fn end_energy(&mut self, system: &System, evaluator: &mut Evaluator) -> f64 {
        if self.stage.off_constraints().is_some() {
            return f64::INFINITY;
        }
        self.stage.configure();
        let Stage { w, offset, c, scratch, .. } = &mut *self.stage;
        let way: Vec<f64> = offset.iter().zip(&*w).map(|(offset, w)| offset + w).collect();
        let kinetic = inertial_energy(system, self.inertia, &way, scratch) / *c;
        kinetic + evaluator.energy(system, &self.stage.q, self.stage.t)
    }
}
