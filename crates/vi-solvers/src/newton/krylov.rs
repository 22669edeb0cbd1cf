//! A full Newton step for equations whose Jacobian J differs from their model A: coupled stages, forces without a
//! potential, discrete gradients. GMRES solves J δ = −R, preconditioned by A⁻¹, with products with J by differences of R;
//! it needs only residuals and corrections of the equations. The step is shortened until A⁻¹R decreases (Deuflhard's natural monotonicity test, Newton Methods for Nonlinear Problems, §3.3).

use crate::error::SolverError;
use crate::linear::gmres;
use crate::newton::equations::{Equations, Solve};
use crate::vectors::norm;

/// Largest number of products with J.
const BASIS: usize = 25;
/// Relative error to which J δ = −R is solved.
const FORCING: f64 = 1e-2;
/// Length of a difference, relative to the unknowns or to the correction.
const DIFFERENCE: f64 = 1e-4;
/// Shortest fraction of a step.
const SHORTEST: f64 = 1e-2;

/// Makes the step from the point of the last correction A⁻¹(−R); returns the fraction of the step that was made.
pub(super) fn step<E: Equations>(solve: &mut Solve<'_, E>) -> Result<f64, SolverError> {
    let first = solve.equations.correction().0.to_vec();
    // Store the point of the last correction.
    solve.equations.advance(0.0);
    let place = solve.equations.unknowns().to_vec();
    let delta = direction(solve, &place, &first)?;
    let size = norm(&first);
    solve.equations.go_to(&place);
    solve.equations.correction().0.copy_from_slice(&delta);
    let longest = solve.largest_step();
    let mut fraction = longest;
    let mut failure = None;
    while fraction >= SHORTEST * longest {
        solve.evaluator.work.line_searches += 1;
        match correct_along(solve, &place, &delta, fraction) {
            Ok(correction) if norm(correction) <= (1.0 - 0.25 * fraction) * size => return Ok(fraction),
            Ok(_) => {}
            Err(error) => failure = Some(error),
        }
        fraction *= 0.5;
    }
    let stuck = SolverError::NoConvergence { iterations: 0, residual: 1.0, tolerance: 0.0 };
    Err(failure.unwrap_or(stuck))
}

/// Returns A⁻¹(−R) at the point that the equations reach from `place` along `direction`.
fn correct_along<'a, E: Equations>(
    solve: &'a mut Solve<'_, E>,
    place: &[f64],
    direction: &[f64],
    length: f64,
) -> Result<&'a [f64], SolverError> {
    solve.equations.go_to(place);
    solve.equations.correction().0.copy_from_slice(direction);
    solve.equations.advance(length);
    solve.evaluate()?;
    solve.correct()?;
    Ok(solve.equations.correction().0)
}

/// Returns δ with ‖A⁻¹(R + Jδ)‖ ≤ forcing · ‖A⁻¹R‖; `first` = −A⁻¹R.
fn direction<E: Equations>(
    solve: &mut Solve<'_, E>,
    place: &[f64],
    first: &[f64],
) -> Result<Vec<f64>, SolverError> {
    let length = DIFFERENCE * norm(place).max(norm(first));
    let product = |v: &[f64]| {
        let there = correct_along(solve, place, v, length)?;
        Ok(first.iter().zip(there).map(|(a, b)| (a - b) / length).collect())
    };
    gmres::solve(product, first, FORCING, BASIS).map(|(delta, _)| delta)
}
