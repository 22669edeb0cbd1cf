//! The last rungs of the ladder: full Newton steps, each with a factor of its own, down the merit that
//! the solution minimises. Where an exact Hessian gives no factor, or a direction along which only a
//! small part of the step descends, the next one is projected. As the merit falls at every step and is
//! bounded below, this converges where the cheap iteration does not.
//!
//! Equations without a merit are first simplified to such as have one, whose solution is near, where there
//! are such; then each step is a full Newton step with their own Jacobian (`krylov`). This room must not know a scheme.

use vi_core::System;

use super::{Attempt, Course, Equations, Newton, ROUND_OFF, SLOPE_KEPT, Solved, Start, krylov};
use crate::forces::Forces;
use crate::inverse::{Inverse, Reason};
use crate::{HessianEvaluation, SolverError};

/// Simplified equations are solved to this relative error: they only give a start.
const SIMPLE_TOLERANCE: f64 = 1e-4;
/// A step shorter than this part of the correction asks for a projected Hessian.
const SHORT: f64 = 0.3;
/// Energies are good to this part of their size.
const ENERGY_NOISE: f64 = 1e-14;
/// So many steps in a row that gain nothing, or are shorter than this part, end the descent.
const IDLE_STEPS: u32 = 8;
const STUCK: f64 = 1e-2;
/// Steps shorter than this do not move.
const SHORTEST: f64 = 1e-10;

impl Newton {
    /// From the best place that is known; `done` iterations have been made before.
    pub(super) fn descend<E: Equations>(
        &mut self,
        system: &System,
        forces: &mut Forces,
        inverse: &mut Inverse,
        equations: &mut E,
        done: u32,
    ) -> Result<Solved, SolverError> {
        forces.work.descents += 1;
        let mut done = done;
        if equations.simplify(true) {
            let simple = best_start(system, forces, equations)
                .and_then(|()| self.full_steps(system, forces, inverse, equations, SIMPLE_TOLERANCE));
            equations.simplify(false);
            let simple = simple?;
            done += simple;
            equations.evaluate(system, forces)?;
            match self.iterate(
                system,
                forces,
                inverse,
                equations,
                Attempt::with_new_factor(self.tolerance),
            )? {
                Course::Solved(Solved { iterations }) => {
                    self.policy.has_descended = simple > 2;
                    return Ok(Solved { iterations: done + iterations });
                }
                Course::Stuck(iterations) => done += iterations,
            }
        } else if equations.has_merit() {
            best_start(system, forces, equations)?;
        } else {
            self.begin(system, forces, equations, self.policy.start)?;
        }
        let iterations = self.full_steps(system, forces, inverse, equations, self.tolerance)?;
        // The factor is that of the last iterate: the next step begins as after any other new factor.
        self.policy.renew();
        self.policy.enter(1, None);
        self.policy.has_descended = iterations > 2;
        Ok(Solved { iterations: done + iterations })
    }

    fn full_steps<E: Equations>(
        &self,
        system: &System,
        forces: &mut Forces,
        inverse: &mut Inverse,
        equations: &mut E,
        tolerance: f64,
    ) -> Result<u32, SolverError> {
        let to_round_off = tolerance <= ROUND_OFF;
        let mut kind = HessianEvaluation::Exact;
        let mut last: Option<f64> = None;
        let mut eta = f64::INFINITY;
        let (mut least, mut idle) = (f64::INFINITY, 0);
        for iteration in 1..=self.max_iterations {
            equations.linearize(system, forces)?;
            inverse.make_as(system, forces, equations.coefficient(), Reason::Newton, kind)?;
            equations.evaluate(system, forces)?;
            let decrement = equations.correct(inverse, forces)?;
            forces.work.newton_iterations += 1;
            equations.advance(1.0);
            eta = if decrement > 0.0 { (decrement / equations.energy_scale()).sqrt() } else { 0.0 };
            let contraction = last.map(|last| eta / last);
            let is_close = match contraction {
                Some(theta) if theta < 1.0 => theta / (1.0 - theta) * eta <= tolerance,
                _ => eta <= 0.1 * tolerance,
            };
            let is_done = if to_round_off {
                self.is_converged(inverse, equations, true, eta, contraction)
            } else {
                is_close || eta == 0.0 || equations.is_at_resolution()
            };
            if is_done {
                return Ok(iteration);
            }
            equations.advance(0.0);
            let step = match equations.merit(system, forces) {
                Some(before) => full_step(system, forces, equations, before, decrement),
                None => {
                    inverse.tighten(true);
                    let step = krylov::step(system, forces, inverse, equations);
                    inverse.tighten(false);
                    step
                }
            };
            let stuck = SolverError::NoConvergence { iterations: iteration, residual: eta, tolerance };
            let fraction = step.map_err(|error| match error {
                SolverError::NoConvergence { .. } => stuck.clone(),
                other => other,
            })?;
            // Without a merit nothing else says that it wanders; with one, that it has met a wall.
            let gains = if equations.has_merit() { fraction > STUCK } else { eta < 0.7 * least };
            idle = if gains { 0 } else { idle + 1 };
            least = least.min(eta);
            if idle == IDLE_STEPS {
                return Err(stuck);
            }
            // The error of a step that was not made in full says nothing of the next one's.
            last = (fraction == 1.0).then_some(eta);
            kind = if fraction < SHORT { HessianEvaluation::Projected } else { HessianEvaluation::Exact };
        }
        Err(SolverError::NoConvergence { iterations: self.max_iterations, residual: eta, tolerance })
    }
}

/// Goes along the correction as far as it descends from the merit `before`; returns the part of it that
/// was gone.
fn full_step<E: Equations>(
    system: &System,
    forces: &mut Forces,
    equations: &mut E,
    before: f64,
    decrement: f64,
) -> Result<f64, SolverError> {
    if decrement <= ENERGY_NOISE * before.abs() {
        equations.advance(1.0);
        return equations.evaluate(system, forces).map(|()| 1.0);
    }
    search(system, forces, equations, before, decrement)
}

/// The place with the least merit among where the equations stand and the starts.
fn best_start<E: Equations>(
    system: &System,
    forces: &mut Forces,
    equations: &mut E,
) -> Result<(), SolverError> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut outcome = Ok(());
    for start in std::iter::once(None).chain(Start::ALL.map(Some)) {
        if let Some(start) = start {
            equations.start(start);
        }
        outcome = equations.evaluate(system, forces);
        let merit = outcome.as_ref().ok().and_then(|()| equations.merit(system, forces));
        if let Some(merit) = merit
            && best.as_ref().is_none_or(|(least, _)| merit < *least)
        {
            best = Some((merit, equations.unknowns().to_vec()));
        }
    }
    let Some((_, unknowns)) = best else { return outcome };
    equations.go_to(&unknowns);
    equations.evaluate(system, forces)
}

/// Searches along the correction for a sufficient decrease of the merit (Armijo's condition), `before`
/// at its start, by parabolas; where the change is within the noise of the energies, the slope decides
/// (Hager, Zhang 2005). Evaluates the residual there and returns the part gone.
pub(super) fn search<E: Equations>(
    system: &System,
    forces: &mut Forces,
    equations: &mut E,
    before: f64,
    decrement: f64,
) -> Result<f64, SolverError> {
    let noise = ENERGY_NOISE * before.abs();
    let mut fraction = 1.0;
    let mut failure = SolverError::NoConvergence { iterations: 0, residual: 1.0, tolerance: 0.0 };
    while fraction > SHORTEST {
        equations.advance(fraction);
        forces.work.line_searches += 1;
        let after = equations.merit(system, forces).unwrap_or(f64::INFINITY);
        let descends = after <= before - 1e-4 * fraction * decrement;
        if descends || (after - before).abs() <= noise {
            match equations.evaluate(system, forces) {
                Ok(()) if descends || equations.slope().abs() <= SLOPE_KEPT * decrement => {
                    return Ok(fraction);
                }
                Ok(()) => {}
                Err(error) => failure = error,
            }
        }
        let parabola = 0.5 * fraction * fraction * decrement / (after - before + fraction * decrement);
        let kept = if parabola.is_finite() { parabola } else { 0.0 };
        fraction = kept.clamp(0.1 * fraction, 0.5 * fraction);
    }
    Err(failure)
}

/// Halves the step, at first the whole correction, until the terms are inside their domain.
pub(super) fn keep_inside<E: Equations>(
    system: &System,
    forces: &mut Forces,
    equations: &mut E,
) -> Result<f64, SolverError> {
    let mut fraction = 1.0;
    let mut outcome = equations.evaluate(system, forces);
    while outcome.is_err() && fraction > 1e-6 {
        fraction *= 0.5;
        equations.advance(fraction);
        forces.work.line_searches += 1;
        outcome = equations.evaluate(system, forces);
    }
    outcome.map(|()| fraction)
}
