//! The minimal residual method for a symmetric, possibly indefinite K, preconditioned by a definite factor of K + σM
//! (Paige & Saunders 1975).

use crate::error::SolverError;
use crate::interrupt::Interrupt;
use crate::linear::factor::Factor;
use crate::linear::matrix::SymmetricMatrix;
use crate::vectors;

/// Solves K x = b with the factor P of K + σM as preconditioner, until the residual in the norm of P⁻¹ is below
/// `tolerance` times its first value. Adds the number of solves with P to `solves`.
pub(crate) fn minimal_residual(
    k: &SymmetricMatrix,
    preconditioner: &mut Factor,
    b: &[f64],
    tolerance: f64,
    max_iterations: u32,
    (interrupt, solves): (&Interrupt, &mut u64),
) -> Result<Vec<f64>, SolverError> {
    let n = b.len();
    let mut x = vec![0.0; n];
    // The Lanczos vectors are v (unpreconditioned) and z = P⁻¹v.
    let (mut v_last, mut v) = (vec![0.0; n], b.to_vec());
    let mut z = v.clone();
    *solves += 1;
    preconditioner.solve(&mut z)?;
    let first = vectors::sum(n, |k| v[k] * z[k]).max(0.0);
    // Take the root of energies in a unit that is a power of two, so that the bits of solutions do not depend on
    // units.
    let per_unit = vectors::per_unit(first);
    let mut beta = (per_unit * first).sqrt();
    if beta == 0.0 {
        return Ok(x);
    }
    let first = beta;
    let mut residual = beta;
    let (mut c, mut c_last, mut s, mut s_last) = (1.0, 1.0, 0.0, 0.0);
    let (mut w, mut w_last) = (vec![0.0; n], vec![0.0; n]);
    let mut image = vec![0.0; n];
    for _ in 0..max_iterations {
        interrupt.check()?;
        let scale = 1.0 / beta;
        vectors::update(&mut v, |_, value| *value *= scale);
        vectors::update(&mut z, |_, value| *value *= scale);
        k.multiply(&z, &mut image);
        let alpha = per_unit * vectors::sum(n, |k| z[k] * image[k]);
        vectors::update(&mut image, |k, value| *value -= alpha * v[k] + beta * v_last[k]);
        let direction = std::mem::replace(&mut z, image.clone());
        *solves += 1;
        preconditioner.solve(&mut z)?;
        let beta_next = (per_unit * vectors::sum(n, |k| image[k] * z[k]).max(0.0)).sqrt();
        // Apply the two previous rotations to the column (0, …, β, α, β⁺).
        let third = s_last * beta;
        let rotated = c_last * beta;
        let second = c * rotated + s * alpha;
        let diagonal = c * alpha - s * rotated;
        let length = diagonal.hypot(beta_next);
        if length == 0.0 {
            break;
        }
        (c_last, s_last) = (c, s);
        (c, s) = (diagonal / length, beta_next / length);
        let (old, older) = (&w, &w_last);
        let mut next = vec![0.0; n];
        vectors::fill(&mut next, |k| (direction[k] - second * old[k] - third * older[k]) / length);
        let along = c * residual;
        vectors::update(&mut x, |k, value| *value += along * next[k]);
        residual *= -s;
        w_last = std::mem::replace(&mut w, next);
        v_last = std::mem::replace(&mut v, image.clone());
        beta = beta_next;
        if residual.abs() <= tolerance * first || beta == 0.0 {
            return Ok(x);
        }
    }
    if residual.abs() <= 1e-6 * first {
        return Ok(x);
    }
    Err(SolverError::NoConvergence {
        iterations: max_iterations,
        residual: residual.abs() / first,
        tolerance,
    })
}
