//! The last stages of Newton's method: full Newton steps, each with its own factor, that decrease the merit function
//! whose minimum is the solution. If an exact Hessian gives no factor, or a direction along which only a small step
//! decreases the merit, the next Hessian is projected. The merit decreases at every step and is bounded below, so
//! this converges where the cheap iteration does not.
//!
//! Equations without a merit function are first simplified, if possible, to equations that have one and whose
//! solution is near. From there each step is a full Newton step with their own Jacobian (`krylov`).

use crate::assemble::hessian::HessianEvaluation;
use crate::error::SolverError;
use crate::newton::attempt::{Attempt, Course, ROUND_OFF, Solved, is_within, relative_error};
use crate::newton::equations::{Equations, Solve};
use crate::newton::inverse::Reason;
use crate::newton::krylov;
use crate::newton::line_search::{ENERGY_NOISE, search};
use crate::newton::solver::Newton;
use crate::newton::start::Start;

/// Relative error to which simplified equations are solved: they only provide a start.
const SIMPLE_TOLERANCE: f64 = 1e-4;
/// A step shorter than this fraction of the correction requests a projected Hessian.
const SHORT: f64 = 0.3;
/// The descent ends after this many consecutive steps without progress: shorter than the fraction `STUCK`, or, for
/// equations without a merit, with an error that does not decrease.
const IDLE_STEPS: u32 = 8;
const STUCK: f64 = 1e-2;

impl Newton {
    /// Descends from the best known point; `done` is the number of iterations made before.
    pub(super) fn descend<E: Equations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        done: u32,
    ) -> Result<Solved, SolverError> {
        solve.evaluator.work.descents += 1;
        let mut done = done;
        if solve.equations.simplify(solve.evaluator, true) {
            let simple = best_start(solve).and_then(|()| self.full_steps(solve, SIMPLE_TOLERANCE));
            solve.equations.simplify(solve.evaluator, false);
            let simple = simple?;
            done += simple;
            solve.evaluate()?;
            match self.iterate(solve, Attempt::with_new_factor(self.tolerance))? {
                Course::Solved(Solved { iterations }) => {
                    self.renewal.has_descended = simple > 2;
                    return Ok(Solved { iterations: done + iterations });
                }
                Course::Stuck(iterations) => done += iterations,
            }
        } else if solve.equations.has_merit() {
            best_start(solve)?;
        } else {
            self.begin(solve, self.renewal.start)?;
        }
        let iterations = self.full_steps_to_new_factor(solve, self.tolerance)?;
        self.renewal.has_descended = iterations > 2;
        Ok(Solved { iterations: done + iterations })
    }

    /// Makes full Newton steps. The factor then belongs to the last iterate; what follows begins as after any other new factor.
    pub(super) fn full_steps_to_new_factor<E: Equations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        tolerance: f64,
    ) -> Result<u32, SolverError> {
        let iterations = self.full_steps(solve, tolerance)?;
        self.renewal.renew();
        self.renewal.record(1, None);
        Ok(iterations)
    }

    fn full_steps<E: Equations>(&self, solve: &mut Solve<'_, E>, tolerance: f64) -> Result<u32, SolverError> {
        let to_round_off = tolerance <= ROUND_OFF;
        let mut kind = HessianEvaluation::Exact;
        let mut last: Option<f64> = None;
        let mut eta = f64::INFINITY;
        let (mut least, mut idle) = (f64::INFINITY, 0);
        for iteration in 1..=self.max_iterations {
            solve.check(self.budget)?;
            solve.linearize()?;
            solve.factorize_as(Reason::Newton, kind)?;
            solve.evaluate()?;
            let decrement = solve.correct()?;
            solve.evaluator.work.newton_iterations += 1;
            if kind == HessianEvaluation::Exact && solve.is_correction_too_long() {
                kind = HessianEvaluation::Projected;
                continue;
            }
            let longest = solve.largest_step();
            solve.equations.advance(longest);
            eta = relative_error(decrement, solve.equations.energy_scale());
            let contraction = last.map(|last| eta / last);
            let is_done = if to_round_off {
                self.is_converged(solve, true, eta, contraction)
            } else {
                is_within(tolerance, eta, contraction) || eta == 0.0 || solve.equations.is_at_resolution()
            };
            if is_done && longest == 1.0 {
                return Ok(iteration);
            }
            solve.equations.advance(0.0);
            let step = match solve.merit() {
                Some(before) => full_step(solve, before, decrement, longest),
                None => {
                    solve.inverse.tighten(true);
                    let step = krylov::step(solve);
                    solve.inverse.tighten(false);
                    step
                }
            };
            let stuck = SolverError::NoConvergence { iterations: iteration, residual: eta, tolerance };
            let fraction = step.map_err(|error| match error {
                SolverError::NoConvergence { .. } => stuck.clone(),
                other => other,
            })?;
            // Without a merit, only the error tells that the iteration makes no progress. With one, a very short step
            // tells that it is stuck.
            let gains = if solve.equations.has_merit() { fraction > STUCK } else { eta < 0.7 * least };
            idle = if gains { 0 } else { idle + 1 };
            least = least.min(eta);
            if idle == IDLE_STEPS {
                return Err(stuck);
            }
            // The error of a step that was not made in full does not predict that of the next one.
            last = (fraction == 1.0).then_some(eta);
            kind = if fraction < SHORT { HessianEvaluation::Projected } else { HessianEvaluation::Exact };
        }
        Err(SolverError::NoConvergence { iterations: self.max_iterations, residual: eta, tolerance })
    }
}

/// Moves along the correction as far as the merit decreases from `before`; returns the fraction of the correction
/// that was used.
pub(super) fn full_step<E: Equations>(
    solve: &mut Solve<'_, E>,
    before: f64,
    decrement: f64,
    longest: f64,
) -> Result<f64, SolverError> {
    if decrement <= ENERGY_NOISE * before.abs() {
        solve.equations.advance(longest);
        return solve.evaluate().map(|()| longest);
    }
    search(solve, before, decrement, longest)
}

/// Moves to the point with the smallest merit among the current one and the initial guesses.
pub(super) fn best_start<E: Equations>(solve: &mut Solve<'_, E>) -> Result<(), SolverError> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut outcome = Ok(());
    for start in std::iter::once(None).chain(Start::ALL.map(Some)) {
        if let Some(start) = start {
            solve.start(start);
        }
        outcome = solve.evaluate();
        let merit = outcome.as_ref().ok().and_then(|()| solve.merit());
        if let Some(merit) = merit
            && best.as_ref().is_none_or(|(least, _)| merit < *least)
        {
            best = Some((merit, solve.equations.unknowns().to_vec()));
        }
    }
    let Some((_, unknowns)) = best else { return outcome };
    solve.equations.go_to(&unknowns);
    solve.evaluate()
}
