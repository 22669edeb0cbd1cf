//! A full Newton step for equations whose Jacobian J differs from their model A: coupled stages, forces without a
//! potential, discrete gradients. GMRES solves J δ = −R, preconditioned by A⁻¹, with products with J by differences of R;
//! it needs only residuals and corrections of the equations. The step is shortened until A⁻¹R decreases (Deuflhard's natural monotonicity test, Newton Methods for Nonlinear Problems, §3.3).
//! Norms are those of lengths: directors of rigid bodies, whose numbers are none, count with their levers.

use std::borrow::Cow;

use crate::error::SolverError;
use crate::linear::gmres;
use crate::newton::equations::{Equations, Solve};
use crate::vectors::{dot, norm};

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
    let lengths = Lengths(solve.equations.levers());
    let delta = direction(solve, &lengths, &place, &first)?;
    let size = norm(&lengths.of(&first));
    solve.equations.go_to(&place);
    solve.equations.correction().0.copy_from_slice(&delta);
    let longest = solve.largest_step();
    let mut fraction = longest;
    let mut failure = None;
    while fraction >= SHORTEST * longest {
        solve.evaluator.work.line_searches += 1;
        match correct_along(solve, &place, &delta, fraction) {
            Ok(correction) if norm(&lengths.of(correction)) <= (1.0 - 0.25 * fraction) * size => {
                return Ok(fraction);
            }
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
    lengths: &Lengths,
    place: &[f64],
    first: &[f64],
) -> Result<Vec<f64>, SolverError> {
    let as_lengths = lengths.of(first);
    let length = DIFFERENCE * norm(&lengths.of(place)).max(norm(&as_lengths));
    let product = |v: &[f64]| {
        let there = correct_along(solve, place, &lengths.back(v), length)?;
        let mut change: Vec<f64> = first.iter().zip(there).map(|(a, b)| (a - b) / length).collect();
        lengths.scale(&mut change);
        Ok(change)
    };
    gmres::solve(product, dot, &as_lengths, FORCING, BASIS)
        .map(|(delta, _)| lengths.back(&delta).into_owned())
}

/// The factors that make lengths of the unknowns, m; `None` if all are lengths.
struct Lengths(Option<Vec<f64>>);

impl Lengths {
    /// Makes lengths of changes of the unknowns.
    fn scale(&self, v: &mut [f64]) {
        if let Some(levers) = &self.0 {
            v.iter_mut().zip(levers).for_each(|(v, lever)| *v *= lever);
        }
    }

    /// Returns the lengths of changes of the unknowns.
    fn of<'a>(&self, v: &'a [f64]) -> Cow<'a, [f64]> {
        if self.0.is_none() {
            return Cow::Borrowed(v);
        }
        let mut lengths = v.to_vec();
        self.scale(&mut lengths);
        Cow::Owned(lengths)
    }

    /// Returns the changes of the unknowns that have these lengths.
    fn back<'a>(&self, v: &'a [f64]) -> Cow<'a, [f64]> {
        match &self.0 {
            Some(levers) => Cow::Owned(v.iter().zip(levers).map(|(v, lever)| v / lever).collect()),
            None => Cow::Borrowed(v),
        }
    }
}
