//! Newton's method for small dense systems, to round-off.

use nalgebra::{DMatrix, DVector};

use crate::error::CoreError;

/// Largest number of iterations.
const MAX_ITERATIONS: usize = 60;
/// An update below this fraction of the unknowns that no longer reduces the residual counts as round-off.
const ROUND_OFF_UPDATE: f64 = 1e-10;

/// Solves residual(u) = 0 from `start` with backtracking on ‖residual‖, until the residual no longer decreases.
/// `extent` is the size of the unknowns to which updates are compared; `singular` is the error for a Jacobian without
/// an inverse.
pub(crate) fn solve(
    start: DVector<f64>,
    extent: f64,
    singular: CoreError,
    residual: impl Fn(&DVector<f64>) -> DVector<f64>,
    jacobian: impl Fn(&DVector<f64>) -> DMatrix<f64>,
) -> Result<DVector<f64>, CoreError> {
    let mut u = start;
    let mut current = residual(&u);
    for iterations in 0..MAX_ITERATIONS {
        let norm = current.norm();
        if norm == 0.0 {
            return Ok(u);
        }
        let Some(update) = jacobian(&u).lu().solve(&current) else {
            return Err(singular);
        };
        let is_tiny = update.amax() <= ROUND_OFF_UPDATE * (extent + u.amax());
        let mut scale = 1.0;
        loop {
            let trial = &u - scale * &update;
            let trial_residual = residual(&trial);
            let trial_norm = trial_residual.norm();
            if is_tiny && (trial_norm.is_nan() || trial_norm > 0.25 * norm) {
                // The residual is at round-off and cannot decrease further. Keep the better of the two.
                return Ok(if trial_norm < norm { trial } else { u });
            }
            if trial_norm <= (1.0 - 1e-4 * scale) * norm {
                (u, current) = (trial, trial_residual);
                break;
            }
            scale *= 0.5;
            if scale < 1e-9 {
                return Err(CoreError::Convergence { iterations, residual: norm });
            }
        }
    }
    Err(CoreError::Convergence { iterations: MAX_ITERATIONS, residual: current.norm() })
}
