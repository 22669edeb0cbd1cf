//! A start for steps whose forces act at their end: passes with lagged friction. In each pass normal forces and directions of slip are
//! those of the last one, so that the step minimises a function, and every correction can be judged by it. The solution of the last
//! pass is near that of the step, from which the pair by pair method (`pairs`) needs two to six iterations.
//!
//! Tractions follow slips from their values at the end of the last pass, as in the method of multipliers: with a stiffness of the order
//! of the inertia that resists. The range of slip in which a bristle of full stiffness sticks is much narrower than corrections are, and
//! descents would zigzag across it.

use crate::error::SolverError;
use crate::newton::attempt::{Attempt, Course};
use crate::newton::descent::best_start;
use crate::newton::equations::Solve;
use crate::newton::pair_equations::{PairEquations, begin_pairs};
use crate::newton::solver::Newton;

/// Number of passes, relative error to which each is solved, and stiffness of bristles ([`vi_core::Acting::penalty`]). Seconds of
/// `backward-euler` on one thread for the cloth of 40 × 40 cells on a sphere (5 ms, μ = .3, .2 s), `tablecloth.toml` (10 ms),
/// `folding-flag.toml` (5 ms, μ = .2, .6 s) and `skirt-on-body.toml` (5 ms):
///
/// | passes | stiffness | sphere | tablecloth | flag | skirt |
/// |---|---|--:|--:|--:|--:|
/// | 3 | 100 | 7.4 | 19.7 | 30.9 | 40.7 |
/// | 2 | 300 | 9.4 | 25.1 | 34.0 | 47.1 |
/// | 3 | 300 | 10.4 | 20.5 | 38.3 | 30.0 |
/// | 3, errors of 1e-4 | 300 | 10.7 | 21.5 | 38.3 | 43.5 |
/// | 3 | 100, 300, 900 | 7.2 | 18.9 | 41.4 | 37.7 |
/// | none | | 24.5 | 24.5 | 33.6 | |
const PASSES: usize = 3;
const ACCURACY: f64 = 1e-5;
const STIFFNESS: f64 = 100.0;
/// A pass that needs no more iterations than this has not changed the solution; the remaining passes are skipped.
const IDLE: u32 = 1;

/// Goes to the solution with lagged friction. Returns the number of iterations.
///
/// # Errors
/// Returns [`SolverError::NoConvergence`] if a pass does not converge, and the errors of evaluations.
pub(super) fn approach<E: PairEquations>(
    newton: &mut Newton,
    solve: &mut Solve<'_, E>,
) -> Result<u32, SolverError> {
    begin_pairs(solve);
    solve.evaluator.set_penalty(STIFFNESS);
    newton.begin(solve, newton.renewal.start)?;
    let unmoved = vec![0.0; solve.equations.unknowns().len()];
    let mut done = 0;
    for pass in 0..PASSES {
        solve.equations.lag(solve.evaluator, pass == 0);
        let outcome = newton.minimise(solve, pass == 0, ACCURACY);
        solve.equations.end_lag(solve.evaluator);
        let iterations = outcome?;
        done += iterations;
        solve.evaluate()?;
        solve.evaluator.predict_tractions(0.0, &unmoved);
        if pass > 0 && iterations <= IDLE {
            break;
        }
    }
    Ok(done)
}

impl Newton {
    /// Minimises the merit of equations to a relative error, from the unknowns; or, if that takes a descent, from the
    /// best start if `is_first`. Returns the number of iterations.
    fn minimise<E: PairEquations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        is_first: bool,
        tolerance: f64,
    ) -> Result<u32, SolverError> {
        let own = std::mem::replace(&mut self.tolerance, tolerance);
        let place = solve.equations.unknowns().to_vec();
        let mut descend = |newton: &mut Self| {
            solve.evaluate()?;
            let done = match newton.iterate(solve, Attempt::new(false))? {
                Course::Solved(solved) => return Ok(solved.iterations),
                Course::Stuck(done) => done,
            };
            solve.evaluator.work.descents += 1;
            match is_first {
                true => best_start(solve)?,
                false => {
                    solve.equations.go_to(&place);
                    solve.evaluate()?;
                }
            }
            Ok(done + newton.full_steps_to_new_factor(solve, tolerance)?)
        };
        let outcome = descend(self);
        self.tolerance = own;
        outcome
    }
}
