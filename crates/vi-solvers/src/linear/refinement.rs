//! Solutions of linear equations by factors, with one iterative refinement.

use crate::error::SolverError;

/// Replaces b by the solution x of A x = b. `solve` replaces a right side by its solution, and `subtract_product` subtracts A x (first argument)
/// from a vector. One refinement makes the residual of every row small relative to its own entries.
///
/// # Errors
/// Returns the errors of `solve`.
pub(crate) fn solve_refined(
    b: &mut [f64],
    solve: impl Fn(&mut [f64]) -> Result<(), SolverError>,
    subtract_product: impl Fn(&[f64], &mut [f64]),
) -> Result<(), SolverError> {
    let mut rest = b.to_vec();
    solve(b)?;
    subtract_product(b, &mut rest);
    solve(&mut rest)?;
    b.iter_mut().zip(&rest).for_each(|(x, change)| *x += change);
    Ok(())
}
