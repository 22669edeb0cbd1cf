//! Newton's method that ends after a fixed number of linear solves, whether it has converged or not. The model is
//! factored once per step, with a projected Hessian, and the merit decreases with each correction. So the result is at
//! least as good as the start, whatever the step, at a cost that is known beforehand. Forces without a potential, as of
//! wind, are linearised once per step, and iterates stay where the constraints are met, so that there is a merit.

use crate::assemble::hessian::HessianEvaluation;
use crate::error::SolverError;
use crate::newton::attempt::{Solved, is_within, relative_error};
use crate::newton::descent::{best_start, full_step};
use crate::newton::equations::{Equations, Solve};
use crate::newton::inverse::Reason;
use crate::newton::solver::Newton;
use crate::newton::start::Start;

/// A solve whose last correction has a larger error counts as stopped short: the energy of the correction is then a hundredth of what the
/// step exchanges. Of 30 steps of 1/60 s of a flag of 12 × 8 cells, none are with E = 1e5 Pa and 8 solves, 11 with 1e8 Pa, and 4 with
/// 1e8 Pa and 30 solves.
const SHORT: f64 = 0.1;

impl Newton {
    /// Makes at most `most` corrections. On return the unknowns hold the last iterate.
    pub(crate) fn truncate<E: Equations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        most: u32,
    ) -> Result<Solved, SolverError> {
        if solve.inverse.is_linear() {
            // One solve is exact. With constraints, a few solves with the same factor go to the tolerance.
            return self.solve(solve);
        }
        solve.equations.keep_constraints(true);
        let solved = self.with_merit(solve, most);
        solve.equations.keep_constraints(false);
        solved
    }

    /// Makes the corrections of equations that have a merit, or that have one once their forces are linearised.
    fn with_merit<E: Equations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        most: u32,
    ) -> Result<Solved, SolverError> {
        if solve.equations.has_merit() {
            return self.truncated(solve, most);
        }
        // Linearise forces without a potential at the position that the body reaches by inertia alone: an extrapolated
        // position could amplify oscillations of earlier steps.
        self.begin(solve, Start::Inertial)?;
        let is_simplified = solve.equations.simplify(solve.evaluator, true);
        let solved = self.truncated(solve, most);
        if is_simplified {
            solve.equations.simplify(solve.evaluator, false);
        }
        solved
    }

    fn truncated<E: Equations>(&self, solve: &mut Solve<'_, E>, most: u32) -> Result<Solved, SolverError> {
        if solve.equations.has_merit() {
            // Set a start that does not depend on the unknowns of the last solve, which are not part of the memory of a
            // stepper.
            solve.start(Start::Predicted);
            best_start(solve)?;
        }
        solve.linearize()?;
        solve.factorize_as(Reason::Newton, HessianEvaluation::Projected)?;
        solve.evaluate()?;
        if solve.equations.has_merit() {
            translate(solve)?;
        }
        let solved = self.corrections(solve, most)?;
        solve.equations.restrain(solve.system, solve.evaluator)?;
        Ok(solved)
    }

    /// Makes at most `most` corrections with the current factor.
    fn corrections<E: Equations>(&self, solve: &mut Solve<'_, E>, most: u32) -> Result<Solved, SolverError> {
        let mut last: Option<f64> = None;
        let mut eta = 0.0;
        for iteration in 1..=most {
            let decrement = solve.correct()?;
            solve.evaluator.work.newton_iterations += 1;
            eta = relative_error(decrement, solve.equations.energy_scale());
            let is_done = eta == 0.0
                || solve.equations.is_at_resolution()
                || is_within(self.tolerance, eta, last.map(|last| eta / last));
            solve.equations.advance(0.0);
            let before = solve.merit().unwrap_or(f64::INFINITY);
            match full_step(solve, before, decrement, 1.0) {
                Ok(fraction) => last = (fraction == 1.0).then_some(eta),
                Err(SolverError::NoConvergence { .. }) => {
                    // Round-off hides any further decrease of the merit.
                    solve.equations.advance(0.0);
                    solve.evaluate()?;
                    return Ok(Solved { iterations: iteration });
                }
                Err(error) => return Err(error),
            }
            if is_done {
                return Ok(Solved { iterations: iteration });
            }
        }
        solve.evaluator.work.stopped_short += u64::from(eta > SHORT);
        Ok(Solved { iterations: most })
    }
}

/// Moves free bodies to where their momentum takes them. Corrections of which only a part is made would leave a part of that momentum out
/// if the solve stops short.
fn translate<E: Equations>(solve: &mut Solve<'_, E>) -> Result<(), SolverError> {
    let unknowns = solve.equations.unknowns().to_vec();
    let residual = solve.equations.correction().1.to_vec();
    if solve.inverse.translate(&residual, solve.equations.correction().0) {
        solve.equations.go_to(&unknowns);
        solve.equations.advance(1.0);
        solve.evaluate()?;
    }
    Ok(())
}
