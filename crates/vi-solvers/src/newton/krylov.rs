//! A full Newton step for equations whose Jacobian J differs from their model A: coupled stages, forces without a
//! potential, discrete gradients. GMRES (Saad, Schultz 1986) solves J δ = −R, preconditioned by A⁻¹, with products
//! with J by differences of R; it needs only residuals and corrections of the equations. The step is shortened until
//! A⁻¹R decreases (Deuflhard's natural monotonicity test, Newton Methods for Nonlinear Problems, §3.3).

use nalgebra::{DMatrix, DVector};

use crate::error::SolverError;
use crate::newton::equations::{Equations, Solve};
use crate::vectors::{self, dot, norm};

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
    let size = norm(first);
    let length = DIFFERENCE * norm(place).max(size);
    let mut basis: Vec<Vec<f64>> = vec![first.iter().map(|value| value / size).collect()];
    let mut hessenberg = DMatrix::zeros(BASIS + 1, BASIS);
    let mut weights = DVector::zeros(0);
    for column in 0..BASIS {
        let there = correct_along(solve, place, &basis[column], length)?;
        let mut image: Vec<f64> = first.iter().zip(there).map(|(a, b)| (a - b) / length).collect();
        // Orthogonalising twice is enough (Kahan, Parlett).
        for _ in 0..2 {
            for (row, other) in basis.iter().enumerate() {
                let part = dot(other, &image);
                hessenberg[(row, column)] += part;
                vectors::update(&mut image, |k, value| *value -= part * other[k]);
            }
        }
        let rest = norm(&image);
        hessenberg[(column + 1, column)] = rest;
        let matrix = hessenberg.view((0, 0), (column + 2, column + 1)).into_owned();
        let mut rhs = DVector::zeros(column + 2);
        rhs[0] = size;
        let Ok(found) = matrix.clone().svd(true, true).solve(&rhs, 1e-14) else { break };
        let residual = (&matrix * &found - &rhs).norm();
        weights = found;
        if residual <= FORCING * size || rest <= 1e-14 * size {
            break;
        }
        vectors::update(&mut image, |_, value| *value /= rest);
        basis.push(image);
    }
    let mut delta = vec![0.0; first.len()];
    for (weight, direction) in weights.iter().zip(&basis) {
        vectors::update(&mut delta, |k, value| *value += weight * direction[k]);
    }
    Ok(delta)
}
