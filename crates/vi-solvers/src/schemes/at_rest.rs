//! Detects a body at rest in equilibrium. An implicit step then needs no Hessian, factor or solve.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::error::SolverError;
use crate::vectors;

/// Number of stencils evaluated at once.
const BATCH: usize = 256;

/// Returns whether the body may be at rest: it does not move and has never moved (no step was made, or the last one
/// had no acceleration). Only then are its forces worth checking.
pub(crate) fn may_be_at_rest(twice_kinetic: f64, last_acceleration: &[f64], steps: usize) -> bool {
    twice_kinetic == 0.0
        && (steps == 0 || vectors::max_abs(last_acceleration.len(), |k| last_acceleration[k]) == 0.0)
}

/// Checks equilibrium at the last configuration of `evaluator`. It compares the energy that the unbalanced force
/// would produce within a stage of coefficient c (s²), with a margin because A ≥ M, with tolerance² times the energy
/// that the individual forces would produce:
///
/// c Σ g²/m ≤ ε² c Σ (Σ_s |g_s|)²/m over the free coordinates, where g_s is the gradient of stencil s.
///
/// # Errors
/// Returns [`SolverError::NotFinite`] if the sum over the unbalanced force overflows, because no step can then be solved.
pub(crate) fn is_at_rest(
    system: &System,
    evaluator: &Evaluator,
    tolerance: f64,
) -> Result<bool, SolverError> {
    let (gradient, mass, free) = (evaluator.gradient(), system.free_mass(), system.coordinates().free());
    let energy = |k: usize| {
        let g = gradient[free[k] as usize];
        g * g / mass[k]
    };
    let unbalanced = vectors::sum(free.len(), energy);
    if unbalanced == 0.0 {
        return Ok(true);
    }
    if !unbalanced.is_finite() {
        let largest = (0..free.len()).max_by(|&a, &b| energy(a).total_cmp(&energy(b)));
        let dof = largest.map_or(0, |k| free[k] as usize);
        return Err(SolverError::NotFinite { what: "square of the force", dof, at_start: true });
    }
    let in_play = magnitudes(system, evaluator.positions(), evaluator.time());
    let total = vectors::sum(free.len(), |k| in_play[free[k] as usize].powi(2) / mass[k]);
    Ok(unbalanced <= tolerance * tolerance * total)
}

/// Returns Σ_s |∂V_s/∂x_i| of every coordinate, N.
fn magnitudes(system: &System, x: &[f64], t: f64) -> Vec<f64> {
    let mut total = vec![0.0; x.len()];
    let mut blocks = Vec::new();
    for term in system.potentials() {
        let stencils = term.stencils();
        let (count, size) = (stencils.count(), stencils.size());
        for first in (0..count).step_by(BATCH) {
            let range = first..count.min(first + BATCH);
            blocks.resize(range.len() * size, 0.0);
            term.gradients(range.clone(), x, t, &mut blocks);
            for (stencil, block) in range.zip(blocks.chunks_exact(size)) {
                for (k, value) in block.iter().enumerate() {
                    let node = stencils.of(stencil)[k / stencils.block] as usize;
                    total[node * stencils.block + k % stencils.block] += value.abs();
                }
            }
        }
    }
    for (node, terms) in system.coordinates().combinations() {
        for &(k, weight) in terms {
            for axis in 0..3 {
                total[3 * k as usize + axis] += weight.abs() * total[3 * node as usize + axis];
            }
        }
    }
    for own in system.coordinates().node_axes() {
        let of_node = &mut total[3 * own.node as usize..][..3];
        let values = [of_node[0], of_node[1], of_node[2]];
        for (out, e) in of_node.iter_mut().zip(&own.axes) {
            *out = (0..3).map(|i| e[i].abs() * values[i]).sum();
        }
    }
    total
}
