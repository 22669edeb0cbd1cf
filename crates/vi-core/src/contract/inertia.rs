//! The consistent mass matrix M, given by quadratic terms of the velocities. M v is the sum of their gradients. M⁻¹p
//! is computed by conjugate gradients with the lumped mass as preconditioner, whose number of iterations does not
//! grow with the mesh (A. J. Wathen, IMA J. Numer. Anal. 7 (1987) 449–457).

use crate::contract::dense;
use crate::contract::terms::Terms;

/// Relative residual that round-off leaves, in units of ε.
const ROUND_OFF: f64 = 4.0;
/// Largest number of iterations. If elements are so distorted that more are needed, the residual shows it.
const LONGEST: u32 = 10_000;
/// Largest number of refinements of a solution by its residual.
const REFINEMENTS: u32 = 3;

/// Returns M q̇. `kinetic` is the kinetic energy as a function of the velocities of all coordinates.
pub(crate) fn momentum(kinetic: &Terms, q_dot: &[f64]) -> Vec<f64> {
    let coordinates = kinetic.coordinates();
    let mut v = vec![0.0; coordinates.dof_count()];
    coordinates.embed(q_dot, 0.0, &mut v);
    let gradient = dense::gradient(kinetic, &v, 0.0);
    let mut p = vec![0.0; q_dot.len()];
    coordinates.restrict(&gradient, &mut p);
    p
}

/// Improves v until M v = p to round-off: ‖p − M v‖ ≤ 4ε ‖p‖, in the norm of the inverse `lumped` mass (positive, of
/// the length of p). `multiply` sets its second argument to M times its first. Returns the number of iterations, 0 if
/// v was accurate enough. All sums have a fixed order, so that equal input gives bitwise equal results.
pub fn solve_mass(
    mut multiply: impl FnMut(&[f64], &mut [f64]),
    lumped: &[f64],
    p: &[f64],
    v: &mut [f64],
) -> u32 {
    let n = p.len();
    let square = |r: &[f64]| -> f64 { r.iter().zip(lumped).map(|(r, m)| r * r / m).sum() };
    let wanted = (f64::EPSILON * ROUND_OFF).powi(2) * square(p);
    let (mut residual, mut direction, mut product) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut iterations = 0;
    for _ in 0..REFINEMENTS {
        multiply(v, &mut product);
        for k in 0..n {
            residual[k] = p[k] - product[k];
        }
        let mut left = square(&residual);
        // A NaN is left to the caller to check.
        if left.is_nan() || left <= wanted {
            break;
        }
        for k in 0..n {
            direction[k] = residual[k] / lumped[k];
        }
        // One quarter of the bound leaves a margin for the round-off in the true residual.
        while left > 0.0625 * wanted && iterations < LONGEST {
            iterations += 1;
            multiply(&direction, &mut product);
            let curvature: f64 = direction.iter().zip(&product).map(|(d, m_d)| d * m_d).sum();
            let step = left / curvature;
            for k in 0..n {
                v[k] += step * direction[k];
                residual[k] -= step * product[k];
            }
            let next = square(&residual);
            for k in 0..n {
                direction[k] = residual[k] / lumped[k] + next / left * direction[k];
            }
            left = next;
        }
    }
    iterations
}
